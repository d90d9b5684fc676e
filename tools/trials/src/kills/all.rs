//! The commands that are ended.

use super::Kills;

const CITY: &str = "scene city --triangles 20K --brick-triangles 2K -o a.bricks";
const GLB: &str = "scene city --triangles 30K -o in.glb";
/// Of a scene that does not fit in the memory that conversions are given.
const LARGE_GLB: &str = "scene city --triangles 200K -o in.glb";

/// `scene`.
pub static SCENE: Kills = Kills {
    name: "kills/scene",
    about: "scene city, in memory",
    before: &[],
    words: "scene city --triangles 60K --brick-triangles 2K -o a.bricks",
    again: "--resume",
    output: Some("a.bricks"),
    keeps: &[],
};

/// `scene` beyond memory.
pub static SCENE_MEMORY: Kills = Kills {
    name: "kills/scene-memory",
    about: "scene city by way of the disk, and --resume",
    before: &[],
    words: "scene city --triangles 200K --memory 56M --brick-triangles 1K --threads 2 -o a.bricks",
    again: "--resume",
    output: Some("a.bricks"),
    keeps: &[],
};

/// `convert`.
pub static CONVERT: Kills = Kills {
    name: "kills/convert",
    about: "convert of a GLB, in memory",
    before: &[GLB],
    words: "convert in.glb --brick-triangles 2K -o a.bricks",
    again: "--resume",
    output: Some("a.bricks"),
    keeps: &[],
};

/// `convert --memory`.
pub static CONVERT_MEMORY: Kills = Kills {
    name: "kills/convert-memory",
    about: "convert of a GLB by way of the disk, and --resume",
    before: &[LARGE_GLB],
    words: "convert in.glb --memory 56M --brick-triangles 1K --threads 2 -o a.bricks",
    again: "--resume",
    output: Some("a.bricks"),
    keeps: &[],
};

/// `convert --lod on`.
pub static LEVELS: Kills = Kills {
    name: "kills/levels",
    about: "convert with levels of detail",
    before: &[GLB],
    words: "convert in.glb --lod on --brick-triangles 2K -o a.bricks",
    again: "",
    output: Some("a.bricks"),
    keeps: &[],
};

/// `bake-displacement`.
pub static DISPLACEMENT: Kills = Kills {
    name: "kills/displacement",
    about: "bake-displacement into the scene itself",
    before: &[CITY],
    words: "bake-displacement a.bricks --positions 290 --adapter cpu",
    again: "",
    output: Some("a.bricks"),
    keeps: &[".a.bricks"],
};

/// `repair`.
pub static REPAIR: Kills = Kills {
    name: "kills/repair",
    about: "repair in place of a damaged scene",
    before: &[GLB, "convert in.glb --brick-triangles 2K -o a.bricks", "!a.bricks"],
    words: "repair a.bricks --from in.glb",
    again: "",
    // It is written in place: bytes that are damaged already are overwritten, and no others.
    output: None,
    keeps: &[],
};

/// `walk`.
pub static WALK: Kills = Kills {
    name: "kills/walk",
    about: "walk with a video and EXR files",
    before: &[CITY],
    words: "walk a.bricks -o out --frames 4 --size 64x36 --adapter cpu --video v.y4m --aov --effects primary,ao",
    again: "",
    output: Some("v.y4m"),
    keeps: &["out/", "v.y4m"],
};

/// `walk --secondary dvf`.
pub static DVF: Kills = Kills {
    name: "kills/dvf",
    about: "walk that makes a field of visibility and keeps it",
    before: &[CITY],
    words: "walk a.bricks -o out --frames 1 --size 32x18 --adapter cpu --effects primary,environment --secondary dvf \
            --dvf-points 2000 --dvf-rays 16 --dvf-cells 8 --dvf-octahedral 8",
    again: "",
    output: Some("a.dvf"),
    keeps: &["out/"],
};

/// `study`.
pub static STUDY: Kills = Kills {
    name: "kills/study",
    about: "study, which goes on where it stopped",
    before: &[CITY],
    words: "study a.bricks --quick --output out --adapter cpu --effects ao --caches 100 --size 32x18 --samples 4 \
            --repeat 1",
    again: "",
    output: None,
    keeps: &["out/"],
};

/// `query`.
pub static QUERY: Kills = Kills {
    name: "kills/query",
    about: "query of nearest points",
    before: &[CITY, "*points.npy"],
    words: "query closest a.bricks points.npy -o out.npy",
    again: "",
    output: Some("out.npy"),
    keeps: &[],
};

/// `trace`.
pub static TRACE: Kills = Kills {
    name: "kills/trace",
    about: "trace of given rays",
    before: &[CITY, "*rays.npy"],
    words: "trace a.bricks --rays rays.npy -o out.npy --adapter cpu --normals",
    again: "",
    output: Some("out.npy"),
    keeps: &[],
};

/// `walk --part`.
pub static PARTS: Kills = Kills {
    name: "kills/parts",
    about: "parts of a walk",
    before: &[CITY],
    words: "walk a.bricks -o out --frames 3 --size 64x36 --adapter cpu --part 0-2",
    again: "",
    output: None,
    keeps: &["out/"],
};

/// `brickwalk-cluster convert`.
pub static CLUSTER: Kills = Kills {
    name: "kills/cluster",
    about: "brickwalk-cluster convert on two workers; it has to be on PATH, of the same commit",
    before: &[LARGE_GLB],
    words: "@brickwalk-cluster convert in.glb --workers 2 --memory 56M --brick-triangles 1K -o a.bricks",
    again: "",
    output: Some("a.bricks"),
    keeps: &[".a.bricks"],
};
