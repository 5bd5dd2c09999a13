from .design import Design as Design
from .design import assess as assess
from .design import design as design
from .guarantee import guarantee as guarantee
from .guarantee import guarantees_of as guarantees_of
from .method import designable as designable
from .method import left_out as left_out
