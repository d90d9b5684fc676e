//! Why a scene could not be built.

/// Why a scene could not be built. Each message says which mesh or setting is at fault and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A setting is outside its range.
    #[error("{setting} is {found}; give {expected}")]
    Setting {
        /// Name of the setting, as on the command line.
        setting: &'static str,
        /// What was given.
        found: String,
        /// What can be given.
        expected: String,
    },
    /// The scene does not hold together: an index without its target, arrays of different lengths.
    #[error("{what}: found {found}, expected {expected}; the file is damaged, export it again")]
    Inconsistent {
        /// The part of the scene.
        what: String,
        /// What is there.
        found: String,
        /// What should be.
        expected: String,
    },
    /// Global ids do not fit 32 bits.
    #[error(
        "the scene has {found} triangles with every instance multiplied out; at most {} can be numbered, \
         split the scene into several files",
        bricks::MAX_TRIANGLE_IDS
    )]
    TooManyTriangles {
        /// The number of triangles.
        found: u64,
    },
    /// A defect of a file.
    #[error("{file}: {defect}")]
    InFile {
        /// The file as given.
        file: String,
        /// What is wrong in it.
        defect: Box<BuildError>,
    },
    /// A vertex that is not a number or infinite.
    #[error(
        "mesh \"{mesh}\", primitive {primitive}: vertex {vertex} is not finite: {position:?}; \
         repair the mesh, or convert with --drop-non-finite to leave such triangles out"
    )]
    NonFinite {
        /// Name of the mesh.
        mesh: String,
        /// Index of the primitive in the mesh.
        primitive: u32,
        /// Index of the vertex in the primitive.
        vertex: u64,
        /// The position in mesh space.
        position: [f64; 3],
    },
    /// A coordinate too large for any lattice.
    #[error(
        "mesh \"{mesh}\", primitive {primitive}: vertex {vertex} lies at {position:?}, farther out than \
         {limit:e}; scale the scene down or remove the vertex"
    )]
    OutOfRange {
        /// Name of the mesh.
        mesh: String,
        /// Index of the primitive in the mesh.
        primitive: u32,
        /// Index of the vertex in the primitive.
        vertex: u64,
        /// The position after its placement.
        position: [f64; 3],
        /// Largest magnitude of a coordinate.
        limit: f64,
    },
    /// A placement that puts an instance too far out or blows it up too much.
    #[error(
        "node \"{node}\": its instance of mesh \"{mesh}\" reaches farther out than {limit:e}; \
         correct the node's matrix or scale the scene down"
    )]
    InstanceOutOfRange {
        /// Name of the node.
        node: String,
        /// Name of the mesh.
        mesh: String,
        /// Largest magnitude of a coordinate.
        limit: f64,
    },
    /// Nothing has the name of what is to be movable.
    #[error("--movable {pattern}: no node with a mesh, nor one above such a node, has this name; there are: {known}")]
    NothingMovable {
        /// The name as given.
        pattern: String,
        /// Names of nodes that there are.
        known: String,
    },
    /// A placement that cannot be an instance.
    #[error(
        "node \"{node}\": it cannot be movable, for its matrix has no inverse or scales one axis too much \
         against another; correct the matrix, or leave the node out of --movable"
    )]
    NotMovable {
        /// Name of the node.
        node: String,
    },
    /// The lattice that was asked for is too fine for the size or place of an object.
    #[error(
        "--lattice {found}: steps of 2^{found} are too fine for {object}, which reaches {reach:e} and is {size:e} \
         large; give --lattice {least} or more, or leave it out"
    )]
    LatticeTooFine {
        /// "the scene" or the name of the mesh.
        object: String,
        /// The exponent that was given.
        found: i32,
        /// Largest magnitude of a coordinate.
        reach: f64,
        /// Diagonal of the bounds.
        size: f64,
        /// Least exponent that can be given for this object.
        least: i32,
    },
    /// More leaves or bricks than indices can name.
    #[error("{what}: found {found}, at most {limit}; raise --brick-triangles or split the scene into several files")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many.
        found: u64,
        /// The limit.
        limit: u64,
    },
    /// Worker threads could not be started.
    #[error("cannot start worker threads: {0}; try fewer with --threads")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// The thread that reads scratch files ahead could not be started.
    #[error(
        "cannot start the thread that reads scratch files: {0}; stop other programs, or raise the limit of threads \
         (ulimit -u)"
    )]
    ReadAhead(std::io::Error),
    /// A part of the source could not be read.
    #[error(transparent)]
    Source(#[from] crate::source::SourceError),
    /// A file of the scratch folder could not be made, read or written.
    #[error(
        "{}: cannot {action} this scratch file or folder: {source}; free some space there or name \
         another folder with --scratch",
        path.display()
    )]
    Scratch {
        /// The file or folder.
        path: std::path::PathBuf,
        /// What was being done.
        action: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A scratch file is not what was written.
    #[error("{}: this scratch file is damaged; convert again without --resume", path.display())]
    ScratchDamaged {
        /// The file.
        path: std::path::PathBuf,
    },
    /// There is a folder where the scratch folder would be.
    #[error(
        "{}: this folder is not the scratch folder of an earlier conversion; remove it or name another \
         folder with --scratch",
        path.display()
    )]
    NotScratch {
        /// The folder.
        path: std::path::PathBuf,
    },
    /// A conversion that is to be continued is another one.
    #[error(
        "{}: the interrupted conversion had other inputs or options; give those (--memory and --threads too) or leave \
         out --resume",
        path.display()
    )]
    OtherConversion {
        /// The scratch folder.
        path: std::path::PathBuf,
    },
    /// Another process leads the conversion, and its journal is not as far as it should be.
    #[error(
        "{}: this journal does not have the steps before the task; let every worker see the scratch folder",
        path.display()
    )]
    Behind {
        /// The journal.
        path: std::path::PathBuf,
    },
    /// Another process leads the conversion, of something else.
    #[error(
        "{}: the conversion that is led from here has other inputs, options or another version than this worker; \
         let every worker see the same files and have the same version",
        path.display()
    )]
    OtherTask {
        /// The scratch folder.
        path: std::path::PathBuf,
    },
    /// Whoever does the tasks of a conversion failed; it can be continued.
    #[error("{reason}; the same conversion with resume continues ({} is kept)", scratch.display())]
    Crew {
        /// What failed.
        reason: String,
        /// The scratch folder.
        scratch: std::path::PathBuf,
    },
    /// The task that was asked for is done; [`super::do_task`] returns this to nobody.
    #[error("the task is done")]
    TaskDone,
    /// Somebody asked to stop.
    #[error(transparent)]
    Interrupted(#[from] crate::progress::Interrupted),
    /// Somebody asked to stop a conversion that can be continued.
    #[error(
        "interrupted; the same command with --resume continues, without it starts anew ({} is kept)",
        scratch.display()
    )]
    Paused {
        /// The scratch folder.
        scratch: std::path::PathBuf,
    },
    /// The scene file could not be written.
    #[error(transparent)]
    File(#[from] bricks::Error),
}
