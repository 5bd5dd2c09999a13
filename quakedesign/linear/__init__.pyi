from .riccati_bounds import uncertainty_bounds as uncertainty_bounds
from .verdict import judge as judge
