from .design import Design as Design
from .design import assess as assess
from .design import design as design
from .guarantee import answers as answers
from .guarantee import guarantee as guarantee
from .method import designable as designable
from .method import left_out as left_out
