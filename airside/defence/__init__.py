"""Defences against neighbours that share what is not so: what a UAV leaves of each value that it has heard.

A stage between `hear` and the law, beneath every scheme, see ``stage``. It gives each heard value a share of its
weight, ``Heard.trust``, and may move values to where the majority's are. It knows no scheme: which values have rates
stands in ``SHARED``. Off, it costs a comparison.
"""
