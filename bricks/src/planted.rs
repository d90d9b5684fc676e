//! Defects that trials plant, to show that they find such: checks that are left out, a file that is overwritten too
//! early. Without the feature `planted` there are none, and [`is`] is a constant.
//!
//! With it, the environment variable `BRICKWALK_PLANTED` names the one that a process has. No program that is used is
//! built with it.

macro_rules! defects {
    ($($(#[$doc:meta])* $name:ident = $text:literal, $kind:literal;)*) => {
        /// A defect.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Defect {
            $($(#[$doc])* $name,)*
        }

        impl Defect {
            /// All of them.
            pub const ALL: [Self; [$($text),*].len()] = [$(Self::$name),*];

            /// Its name.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$name => $text,)*
                }
            }

            /// The kind of trials that has to find it.
            pub fn kind(self) -> &'static str {
                match self {
                    $(Self::$name => $kind,)*
                }
            }
        }
    };
}

defects! {
    /// An image of a texture may be larger than its bytes can hold.
    ImageSize = "image-size", "inputs/glb";
    /// Compressed geometry may state more elements than its bytes can hold.
    MeshoptCount = "meshopt-count", "inputs/meshopt";
    /// A tileset may refer to itself.
    TilesetCircle = "tileset-circle", "inputs/tiles";
    /// A reference of a model may lead out of its folder.
    Outside = "outside", "inputs/gltf";
    /// A picture may be larger than its bytes can hold.
    PngSize = "png-size", "inputs/pictures";
    /// A NumPy file may state more rows than it holds.
    NpyRows = "npy-rows", "inputs/npy";
    /// An HDR image may be larger than its bytes can hold.
    HdrSize = "hdr-size", "inputs/environment";
    /// Times of keyframes need not ascend.
    KeyframeTimes = "keyframe-times", "inputs/paths";
    /// A field of visibility may have a cell outside.
    DvfCell = "dvf-cell", "inputs/dvf";
    /// An entry of a disk cache is read however long it is.
    EntryLength = "entry-length", "inputs/disk-cache";
    /// The head of a part may be longer than the file.
    PartHead = "part-head", "inputs/parts";
    /// Payloads of a scene file may lie anywhere.
    PayloadEnd = "payload-end", "inputs/bricks";
    /// A triangle of a brick may name a vertex that is not there.
    BrickVertex = "brick-vertex", "inputs/bricks";
    /// Payloads are not held against their checksums.
    Checksum = "checksum", "faults/queries";
    /// A map is read without asking how long the file still is.
    MapLength = "map-length", "faults/files";
    /// What a batch is about to use may be overwritten.
    Pin = "unpinned-slot", "differences/schedules";
    /// Queries take what lies before a ray's least distance.
    LeastDistance = "least-distance", "differences/queries";
    /// What a device refuses ends the process.
    DeviceRefusal = "device-refusal", "device/limits";
    /// Who waits for a wish is not told of it.
    Unnotified = "lost-wake-up", "threads/inbox";
    /// Room that was reserved in vain is never given back.
    HeldBytes = "held-bytes", "threads/host-cache";
    /// A scene file is emptied before the new one is finished.
    OldOutput = "old-output", "kills/scene";
    /// What killed processes left is never removed.
    Leftovers = "leftovers", "kills/walk";
    /// A step of a conversion is recorded before what it wrote is out of this process.
    EarlyRecord = "early-record", "kills/scene-memory";
}

/// Whether this process has the defect.
#[cfg(feature = "planted")]
pub fn is(defect: Defect) -> bool {
    static NAME: std::sync::OnceLock<Option<String>> = std::sync::OnceLock::new();
    NAME.get_or_init(|| std::env::var("BRICKWALK_PLANTED").ok()).as_deref() == Some(defect.name())
}

/// Whether this process has the defect: never.
#[cfg(not(feature = "planted"))]
#[inline(always)]
pub const fn is(_: Defect) -> bool {
    false
}
