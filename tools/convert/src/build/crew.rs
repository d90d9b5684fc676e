//! Who does the costly steps of a conversion: this process, or others that it leads.
//!
//! Such a step is divided into tasks. A task reads what earlier steps left in the scratch folder and writes shards
//! there ([`super::disk::shard`]); these are all that is known of it. So it may be done by any process that sees the
//! inputs and the folder, more than once, and by several at a time. A process that is asked for a task goes through the
//! same steps as the one that leads ([`super::do_task`]): it takes their results from the journal, up to the step at
//! hand.

use super::disk::journal::Step;
use super::disk::scratch::Scratch;
use super::error::BuildError;

/// Tasks that the runs of triangles of a step make, where there are enough of them.
const STEP_TASKS: usize = 32;

/// Items of a task that goes through them, at least.
const TASK_ITEMS: u64 = 1 << 19;

/// Runs of triangles of a task at most.
const MOST_RUNS: usize = 8;

/// Tasks of a step of a conversion that several processes may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaskStep {
    /// What is done, one word.
    pub name: &'static str,
    /// Steps of the conversion before it.
    pub position: u64,
    /// A number that only this conversion has.
    pub conversion: u64,
}

/// Does the tasks of conversions, each with [`super::do_task`] in some process.
pub trait Crew: Sync {
    /// Has tasks of a step done. Calls `done` for each, in the order of `tasks`, as soon as it and all before it are
    /// done. Where, in which order and how often they are done does not matter.
    ///
    /// # Errors
    /// That of `done`, as it is. A task cannot be done, or somebody asked to stop.
    fn perform(
        &self,
        step: &TaskStep,
        tasks: &[u64],
        done: &mut dyn FnMut(u64) -> Result<(), BuildError>,
    ) -> Result<(), CrewError>;
}

/// Why tasks are not done.
#[derive(Debug)]
pub enum CrewError {
    /// What was done with their results failed.
    Build(BuildError),
    /// They could not be done: one line.
    Failed(String),
}

impl From<BuildError> for CrewError {
    fn from(error: BuildError) -> Self {
        Self::Build(error)
    }
}

/// Who does the tasks of a conversion.
#[derive(Clone, Copy)]
pub(super) enum Hands<'a> {
    /// This process.
    Own,
    /// Other processes that this one leads.
    Crew(&'a dyn Crew),
    /// This process does one task: a number, of the step with this name.
    Task(&'a str, u64),
}

/// The tasks of a step.
pub(super) struct Tasks<'t> {
    /// What is done.
    pub step: Step,
    /// Steps before it.
    pub position: u64,
    /// How many there are.
    pub count: usize,
    /// The shards that one makes.
    pub shards: &'t dyn Fn(usize) -> Vec<String>,
    /// Does one.
    pub work: &'t dyn Fn(usize) -> Result<(), BuildError>,
}

impl Hands<'_> {
    /// Whether several processes do the tasks.
    pub fn are_many(&self) -> bool {
        !matches!(self, Self::Own)
    }

    /// Whether this process does one task of a conversion that another leads.
    pub fn is_task(&self) -> bool {
        matches!(self, Self::Task(..))
    }

    /// How many of so many tasks, each of which takes all the memory, make up a step.
    pub fn at_once(&self, tasks: usize) -> usize {
        if self.are_many() { tasks.max(1) } else { 1 }
    }

    /// How many of so many runs of triangles make up a task.
    pub fn runs_per_task(&self, runs: usize) -> usize {
        if self.are_many() { (runs / STEP_TASKS).clamp(1, MOST_RUNS) } else { runs.max(1) }
    }

    /// How many of the `parts` that so many items lie in make up a task.
    pub fn parts_per_task(&self, items: u64, parts: usize) -> usize {
        let tasks = if self.are_many() { (items / TASK_ITEMS).clamp(1, STEP_TASKS as u64) as usize } else { 1 };
        parts.div_ceil(tasks).max(1)
    }

    /// Has all tasks of a step done, and hands each in order to `take`. What `take` finds damaged is made once more.
    pub fn perform(
        &self,
        scratch: &Scratch,
        tasks: &Tasks,
        take: &mut dyn FnMut(usize) -> Result<(), BuildError>,
    ) -> Result<(), BuildError> {
        match *self {
            Self::Own => (0..tasks.count).try_for_each(|task| {
                (tasks.work)(task)?;
                take(task)
            }),
            Self::Crew(crew) => {
                let step =
                    TaskStep { name: tasks.step.name(), position: tasks.position, conversion: scratch.conversion() };
                let all: Vec<u64> = (0..tasks.count as u64).collect();
                let done = crew.perform(&step, &all, &mut |task| match take(task as usize) {
                    Err(BuildError::ScratchDamaged { .. }) => {
                        scratch.remove(&(tasks.shards)(task as usize));
                        let again = crew.perform(&step, &[task], &mut |task| take(task as usize));
                        again.map_err(|error| error.told(scratch))
                    }
                    taken => taken,
                });
                done.map_err(|error| error.told(scratch))
            }
            Self::Task(name, task) => {
                let is_at_hand = name == tasks.step.name() && task < tasks.count as u64;
                if !is_at_hand {
                    return Err(BuildError::OtherTask { path: scratch.path().to_owned() });
                }
                let verifies = |name: &String| scratch.shard(name).and_then(|shard| shard.verify()).is_ok();
                if !(tasks.shards)(task as usize).iter().all(verifies) {
                    (tasks.work)(task as usize)?;
                    scratch.settle()?;
                }
                Err(BuildError::TaskDone)
            }
        }
    }
}

impl CrewError {
    fn told(self, scratch: &Scratch) -> BuildError {
        match self {
            Self::Build(error) => error,
            Self::Failed(reason) => BuildError::Crew { reason, scratch: scratch.path().to_owned() },
        }
    }
}
