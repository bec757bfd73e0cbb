from .writing import TemplateError as TemplateError
from .writing import write_law as write_law
