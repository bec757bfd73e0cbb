from .lead import Nodes as Nodes
from .node import NodeOptions as NodeOptions
from .node import run_node as run_node
from .plan import NodesError as NodesError
from .plan import NodesPlan as NodesPlan
from .plan import read_plan as read_plan
