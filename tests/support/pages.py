"""What a page holds, read back from its text."""

import json
import re
from pathlib import Path
from typing import Any


def page_scene(path: Path) -> dict[str, Any]:
    """The scene that a page's viewer reads."""
    text = path.read_text("utf-8")
    (scene,) = re.findall(r'type="application/json">(.*?)</script>', text, re.DOTALL)
    return json.loads(scene)
