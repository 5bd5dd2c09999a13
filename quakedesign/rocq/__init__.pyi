from .rocq_export import rocq_text as rocq_text
from .rocq_export import write_rocq as write_rocq
