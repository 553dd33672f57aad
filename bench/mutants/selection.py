# SPDX-License-Identifier: Apache-2.0
"""Which files are mutated, and which of their mutants a seed chooses."""
import hashlib
import math

from operators import collect_flags, mutants_of

# By the programs that are built of them: the layer, or the programs of tests that are linked with the tested code.
PATTERNS = {}
# The code that decides hits and makes the data for looking them up.
PATTERNS["layer"] = [
    "src/core/opacity.h", "src/core/curve.h", "src/core/records.h", "src/core/ray_flags.h",
    "src/shaders/base/*", "src/shaders/micromaps/*", "src/shaders/structures/*", "src/shaders/pipelines/*",
    "src/shaders/query_pool/*",
    "src/layer/input/*.cpp", "src/layer/input/*.h", "src/layer/micromaps/*.cpp", "src/layer/micromaps/*.h",
    "src/layer/structures/*.cpp", "src/layer/structures/*.h",
    "src/layer/command_buffer/injected_work.cpp", "src/layer/state/root_table.cpp",
    "src/layer/state/acceleration_structure.cpp", "src/layer/query_pool/query_pool.cpp",
    "src/layer/pipelines/driver_stages.cpp", "src/layer/pipelines/hit_records.cpp",
    "src/layer/pipelines/micromap_stages.cpp", "src/layer/pipelines/shaders.cpp",
    "src/layer/pipelines/ray_tracing_pipeline.cpp",
    "src/spirv/candidate*.cpp", "src/spirv/consumption.cpp", "src/spirv/entry_wrapper.cpp",
    "src/spirv/payload_prefix.cpp", "src/spirv/proceed_loop.cpp", "src/spirv/ray_query.cpp",
    "src/spirv/side_variables.cpp", "src/spirv/trace_ray.cpp",
]
PATTERNS["programs"] = [
    "src/bake/**/*.cpp", "src/bake/**/*.h", "src/gltf/**/*.cpp", "src/gltf/**/*.h", "src/verify/**/*.cpp",
    "src/verify/**/*.h", "src/library/*.cpp", "src/gltflibrary/*.cpp",
]
EXCLUDED = ["src/**/*_windows.cpp", "src/gltf/data/image_stb.cpp", "src/gltf/data/no_mesh_libraries.cpp"]  # not built here


def all_mutants(root, target="layer"):
    files = sorted({path for pattern in PATTERNS[target] for path in root.glob(pattern) if path.is_file()} -
                   {path for pattern in EXCLUDED for path in root.glob(pattern)})
    sources = {str(path.relative_to(root)): path.read_text(encoding="utf-8") for path in files}
    flags = collect_flags(sources.values())
    return [mutant for name, source in sources.items() for mutant in mutants_of(name, source, flags)]


def draw(seed, words):
    """A number from 0 to 1 that depends on seed and words only."""
    digest = hashlib.sha256(f"{seed} {words}".encode()).digest()
    return int.from_bytes(digest[:8], "big") / 2**64


def choose(mutants, seed, count):
    """The first `count` of an order in which each file and operator has a share that grows with the root of its size.

    A longer choice with the same seed begins with the shorter one.
    """
    strata = {}
    for mutant in mutants:
        strata.setdefault((mutant.file, mutant.operator), []).append(mutant)
    keys = {}
    for stratum, members in strata.items():
        members = sorted(members, key=lambda mutant: draw(seed, mutant.id))
        for rank, mutant in enumerate(members):
            keys[mutant.id] = (rank + draw(seed, stratum)) / math.sqrt(len(members))
    return sorted(mutants, key=lambda mutant: (keys[mutant.id], mutant.id))[:count]
