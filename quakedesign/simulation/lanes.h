#ifndef LANES
#define LANES ${lanes}
#endif
