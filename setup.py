"""Map the top-level folders codegen, cycles and verification into the package qpmpc.

Everything else about the build is in pyproject.toml. The packages are found here because
setuptools cannot find packages below a renamed folder from a static table. Folders of data count
as packages too, as setuptools requires.
"""

from setuptools import find_namespace_packages, setup

folders = {
    "qpmpc": "qpmpc",
    "qpmpc.codegen": "codegen",
    "qpmpc.cycles": "cycles",
    "qpmpc.verification": "verification",
}

packages = [
    name
    for package, folder in folders.items()
    for name in (
        package,
        *(f"{package}.{sub}" for sub in find_namespace_packages(folder, exclude=["*__pycache__"])),
    )
]

setup(packages=packages, package_dir=folders)
