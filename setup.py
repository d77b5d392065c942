"""Map the top-level folders codegen, cycles and verification into the package qpmpc.

Everything else about the build is in pyproject.toml. The packages are found here because
setuptools cannot find packages below a renamed folder from a static table.
"""

from setuptools import find_packages, setup

mapped = ("codegen", "cycles", "verification")

packages = find_packages(include=["qpmpc", "qpmpc.*"])
for folder in mapped:
    packages += [f"qpmpc.{name}" for name in find_packages(include=[folder, f"{folder}.*"])]

setup(packages=packages, package_dir={f"qpmpc.{folder}": folder for folder in mapped})
