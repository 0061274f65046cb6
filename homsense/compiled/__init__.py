"""The hot loops for numba; on the same arrays and with the same results as the reference.

A compiled call keeps the interpreter lock, so readers and the writer never run in the midst of
one another.
"""
