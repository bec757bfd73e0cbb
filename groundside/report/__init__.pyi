from .comparison import Comparison as Comparison
from .report import write_report as write_report
from .terminal import as_json as as_json
from .terminal import claims_table as claims_table
from .terminal import show as show
from .terminal import show_claims as show_claims
from .terminal import show_verdict as show_verdict
from .terminal import summary as summary
