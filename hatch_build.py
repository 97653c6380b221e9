"""What hatchling builds in: the description that the package index shows, and the wheel's bill of materials.

In the repository and on the site the links of README.md are relative, and so right in every clone. The index
has no files to lead to: a link leads to the repository at the release's tag instead.

The bill (PEP 770, CycloneDX) lies in the wheel's ``.dist-info/sboms``. The wheel contains nothing of others:
the bill names what is installed with it. It has neither time nor serial number: the same sources make the
same wheel.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

sys.path.insert(0, str(Path(__file__).parent))

from docs.site.absolute import absolute


class Readme(MetadataHookInterface):
    """Asked by hatchling, whatever it builds."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the description."""
        text = Path(self.root, "README.md").read_text(encoding="utf-8")
        text = absolute(text, metadata["urls"]["Repository"], metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


class Bill(BuildHookInterface[Any]):
    """Asked by hatchling when it builds a wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Add the bill of materials."""
        core = self.metadata.core
        text = json.dumps(
            bill(core.name, self.metadata.version, core.dependencies, core.optional_dependencies), indent=1
        )
        self._folder = TemporaryDirectory()
        file = Path(self._folder.name, "robotiq_async.cdx.json")
        file.write_text(f"{text}\n", encoding="utf-8")
        build_data["sbom_files"].append(str(file))

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002
        """Remove the file."""
        self._folder.cleanup()


def bill(name: str, version: str, base: list[str], extras: dict[str, list[str]]) -> dict[str, Any]:
    """The bill of materials of a wheel, from its requirements: the base needs them, the extras may."""
    package = f"pkg:pypi/{name}@{version}"
    optional = [each for extra, wanted in extras.items() if extra != "dev" for each in wanted]
    components: dict[str, dict[str, Any]] = {}
    for scope, wanted in (("required", base), ("optional", optional)):
        for requirement in wanted:
            found = re.match(r"[\w.-]+", requirement)
            if found is None or found[0] == name:
                continue
            components.setdefault(
                f"pkg:pypi/{found[0].lower()}",
                {
                    "type": "library",
                    "bom-ref": f"pkg:pypi/{found[0].lower()}",
                    "name": found[0],
                    "purl": f"pkg:pypi/{found[0].lower()}",
                    "scope": scope,
                    "properties": [{"name": "requirement", "value": requirement}],
                },
            )
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "library",
                "bom-ref": package,
                "name": name,
                "version": version,
                "purl": package,
                "licenses": [{"license": {"id": "MIT"}}],
            }
        },
        "components": list(components.values()),
        "dependencies": [{"ref": package, "dependsOn": list(components)}],
    }
