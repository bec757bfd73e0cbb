"""Elements of fault-tolerant control: what recurs in the schemes, each once, each with its equations.

An element is a compiled function of scalars. Where it has states it returns their rates, and the law integrates them,
unless a stiff element says that it steps itself.
"""
