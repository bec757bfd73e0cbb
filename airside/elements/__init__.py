"""Elements of fault-tolerant control: the parts that several schemes share. Each stands once, with its equations.

An element is a compiled function of scalars or of vectors of three. An element with states returns their rates, and the
law integrates them; a stiff element says that it steps itself.
"""
