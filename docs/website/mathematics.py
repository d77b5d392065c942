"""Blocks marked ``math`` become MathML, which browsers draw themselves; git hosts know them too."""

from typing import Any

from latex2mathml.converter import convert


def _math(source: str, *_: Any, **__: Any) -> str:
    return convert(source.strip(), display="block")


def on_config(config: Any) -> Any:
    """Add the kind of block to the Markdown extension that reads fenced blocks."""
    config.markdown_extensions.append("pymdownx.superfences")
    fence = {"name": "math", "class": "math", "format": _math}
    config.mdx_configs["pymdownx.superfences"] = {"custom_fences": [fence]}
    return config
