"""Check the shipped packages: versions, licences, sources and duplicates of crates, and pins of Python packages.

deny.toml contains the rules. cargo-deny, cargo-audit and pip-audit know security advisories. Those that are installed run too. The exit
code is 1 if a check fails.
"""

import json
import re
import shutil
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RULES = tomllib.loads((ROOT / "deny.toml").read_text())


def cargo(*arguments: str) -> str:
    """The output of a cargo command. The network is used only if the command fails offline."""
    command = ["cargo", *arguments, "--locked"]
    run = subprocess.run([*command, "--offline"], cwd=ROOT, capture_output=True, text=True)
    return run.stdout if run.returncode == 0 else subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def crates() -> list[dict[str, Any]]:
    """Every crate that is built for the wheel or its tests on any system. The lock file also lists optional crates that nothing builds."""
    tree = cargo("tree", "--workspace", "--target", "all", "--edges", "normal,build,dev", "--prefix", "none", "--format", "{p}")
    built = {tuple(line.split()[:2]) for line in tree.splitlines() if line}
    packages = json.loads(cargo("metadata", "--format-version", "1"))["packages"]
    return [package for package in packages if (package["name"], f"v{package['version']}") in built]


def permitted(licence: str | None, allowed: set[str]) -> bool:
    """Whether the allowed licences satisfy an SPDX expression: all parts of an AND, one part of an OR (or of the older slash)."""
    parts = (licence or "").replace("/", " OR ").split(" AND ")
    return all(allowed & {name.strip(" ()") for name in part.split(" OR ")} for part in parts)


def of_licences(packages: list[dict[str, Any]]) -> list[str]:
    allowed = set(RULES["licenses"]["allow"])
    return [f"{p['name']} {p['version']}: licence {p['license']}" for p in packages if not permitted(p["license"], allowed)]


def of_sources(packages: list[dict[str, Any]]) -> list[str]:
    return [f"{p['name']}: comes from {p['source']}" for p in packages if p["source"] and not p["source"].startswith("registry+")]


def of_duplicates(packages: list[dict[str, Any]]) -> list[str]:
    skipped = {entry["name"] for entry in RULES["bans"]["skip"]}
    counts = Counter(p["name"] for p in packages)
    return [f"{name}: {n} versions" for name, n in counts.items() if n > 1 and name not in skipped]


def of_versions(packages: list[dict[str, Any]]) -> list[str]:
    """Faults if Cargo.toml, CITATION.cff and the first entry of the changelog have different versions."""
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    logged = re.search(r"^## \[([\d.]+)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    found = {"CITATION.cff": cited and cited[1], "CHANGELOG.md": logged and logged[1]}
    return [f"{name} says {value}, Cargo.toml {version}" for name, value in found.items() if value != version]


def of_pins(packages: list[dict[str, Any]]) -> list[str]:
    """Faults if a package for the build, the tests or the documentation is not pinned. The other files of requirements/ are not checked."""
    loose = []
    for name in ("test.txt", "docs.txt"):
        for line in (ROOT / "requirements" / name).read_text().splitlines():
            if line and not line.startswith("#") and "==" not in line:
                loose.append(f"requirements/{name}: {line}")
    return loose


CHECKS = {"licences": of_licences, "sources": of_sources, "duplicates": of_duplicates, "versions": of_versions, "pins": of_pins}
TOOLS = {
    "cargo-deny": ["cargo", "deny", "check"],
    "cargo-audit": ["cargo", "audit"],
    "pip-audit": [
        sys.executable,
        "-m",
        "pip_audit",
        "--disable-pip",
        "--no-deps",
        "-r",
        "requirements/test.txt",
        "-r",
        "requirements/docs.txt",
    ],
}


def installed(tool: str) -> bool:
    if tool == "pip-audit":
        return subprocess.run([sys.executable, "-c", "import pip_audit"], capture_output=True).returncode == 0
    return shutil.which(tool) is not None


def main() -> int:
    packages = crates()
    wrong = 0
    for name, check in CHECKS.items():
        faults = check(packages)
        wrong += len(faults)
        print(f"{name:>10}: {'ok' if not faults else '; '.join(faults)}")
    print(
        f"{'crates':>10}: {len(packages)}; "
        + ", ".join(f"{n} {licence}" for licence, n in Counter(p["license"] for p in packages).most_common())
    )
    for tool, command in TOOLS.items():
        if not installed(tool):
            print(f"{tool:>10}: not installed, advisories not looked up")
        elif subprocess.run(command, cwd=ROOT).returncode:
            wrong += 1
            print(f"{tool:>10}: failed")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
