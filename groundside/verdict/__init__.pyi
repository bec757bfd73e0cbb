from .judging import columns_judged as columns_judged
from .judging import judge as judge
from .verdict import AS_IT_SHOULD as AS_IT_SHOULD
from .verdict import FAILED as FAILED
from .verdict import REMARKS as REMARKS
from .verdict import VERDICT_FILE as VERDICT_FILE
from .verdict import Verdict as Verdict
from .verdict import with_unit as with_unit
