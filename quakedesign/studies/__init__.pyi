from .comparison import Entry as Entry
from .paper import FrontPoint as FrontPoint
from .paper import objective_front as objective_front
from .performance_limits import Limit as Limit
from .performance_limits import Limits as Limits
from .performance_limits import limits as limits
from .runs import natural_run as natural_run
from .scaling import scale_answer as scale_answer
