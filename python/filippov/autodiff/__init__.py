"""Runs as parts of differentiable programs: `with_jax` for JAX, `with_torch` for PyTorch.

Each module has one function, `solve`. Neither is imported here, because both packages are optional: write
``from filippov.autodiff import with_jax`` or ``from filippov.autodiff import with_torch``.
"""
