//! Conversions whose tasks other processes do: one leads, the others do what it hands out.

use crate::build::{Conversion, built, told, watched};
use crate::worker::{Progress, Task, run_alone};
use brickwalk_convert::build::{BuildError, BuildSettings, Crew, CrewError, TaskStep, build_shared, do_task};
use brickwalk_convert::import::{Imported, import};
use brickwalk_convert::progress::Interrupted;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator};
use std::path::PathBuf;
use std::sync::Arc;

/// Hands tasks to a callable.
struct Callable {
    perform: Py<PyAny>,
    task: Arc<Task>,
}

/// What an iterator of results says next.
enum Next {
    Done,
    NotYet,
    Ended,
}

/// A generator that is closed with this, so that it gives up what it waits for.
struct Results(Py<PyIterator>);

impl Results {
    fn next(&self) -> PyResult<Next> {
        Python::attach(|py| match self.0.bind(py).clone().next() {
            None => Ok(Next::Ended),
            Some(item) => Ok(if item?.is_none() { Next::NotYet } else { Next::Done }),
        })
    }
}

impl Drop for Results {
    fn drop(&mut self) {
        Python::attach(|py| {
            // Other iterators have nothing to close.
            let _ = self.0.bind(py).call_method0("close");
        });
    }
}

/// A Python exception as one line.
fn line(error: PyErr) -> CrewError {
    Python::attach(|py| {
        let text = error.value(py).to_string().replace('\n', " ");
        // The errors of this package say it all.
        let is_own = error.is_instance_of::<PyRuntimeError>(py) && !text.is_empty();
        let name = error.get_type(py).name().map_or_else(|_| "error".to_owned(), |name| name.to_string());
        CrewError::Failed(if is_own { text } else { format!("{name}: {text}") })
    })
}

impl Crew for Callable {
    fn perform(
        &self,
        step: &TaskStep,
        tasks: &[u64],
        done: &mut dyn FnMut(u64) -> Result<(), BuildError>,
    ) -> Result<(), CrewError> {
        let begun = Python::attach(|py| {
            let arguments = (step.name, step.position, step.conversion, tasks.to_vec());
            Ok(Results(self.perform.bind(py).call1(arguments)?.try_iter()?.unbind()))
        });
        let results = begun.map_err(line)?;
        for &task in tasks {
            loop {
                if self.task.is_stopped() {
                    return Err(BuildError::from(Interrupted).into());
                }
                match results.next().map_err(line)? {
                    Next::Done => break,
                    Next::NotYet => {}
                    Next::Ended => {
                        let missing = format!("task {task} of {}: nobody said that it is done", step.name);
                        return Err(CrewError::Failed(missing));
                    }
                }
            }
            done(task)?;
        }
        Ok(())
    }
}

/// Converts models into the scene file `out`; `perform` has the tasks of a step done by [`ConversionWorker`] objects:
/// given its name, its position, a number that only this conversion has, and numbers of tasks, it returns an iterator.
/// This yields something for each of the tasks, in their order, when it is done; and from time to time `None`.
#[pyfunction]
pub fn convert_shared<'py>(
    py: Python<'py>,
    inputs: Vec<PathBuf>,
    out: PathBuf,
    settings: &Bound<'py, PyDict>,
    perform: Py<PyAny>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let conversion = Conversion::new(py, inputs, &out, settings)?;
    let work = move |task: &Arc<Task>| {
        watched(task, |progress| {
            let Conversion { inputs, importing, building } = &conversion;
            let source = import(inputs, importing, progress)?;
            let crew = Callable { perform, task: task.clone() };
            built(build_shared(&source, building, &out, &crew, progress))
        })
    };
    let summary = run_alone(py, &mut Progress::new(progress, 0), work)?;
    let phases = PyDict::new(py);
    for (name, time) in &summary.phases {
        phases.set_item(name, time.as_secs_f64())?;
    }
    let dict = told(py, summary)?;
    dict.set_item("phases", phases)?;
    Ok(dict)
}

/// Does tasks of a conversion that another process leads with the same arguments.
#[pyclass(frozen)]
pub struct ConversionWorker {
    source: Arc<Imported>,
    building: BuildSettings,
    out: PathBuf,
}

#[pymethods]
impl ConversionWorker {
    /// Opens the inputs.
    #[new]
    fn new(py: Python<'_>, inputs: Vec<PathBuf>, out: PathBuf, settings: &Bound<'_, PyDict>) -> PyResult<Self> {
        let Conversion { inputs, importing, building } = Conversion::new(py, inputs, &out, settings)?;
        let work = move |task: &Arc<Task>| watched(task, |progress| Ok(import(&inputs, &importing, progress)?));
        let source = Arc::new(run_alone(py, &mut Progress::new(None, 0), work)?);
        Ok(Self { source, building, out })
    }

    /// Does a task of a step, unless it is done. Other Python threads go on meanwhile.
    fn perform(&self, py: Python<'_>, step: String, position: u64, task: u64) -> PyResult<()> {
        let (source, building, out) = (self.source.clone(), self.building.clone(), self.out.clone());
        let work = move |its: &Arc<Task>| {
            watched(its, |progress| Ok(do_task(&*source, &building, &out, (&step, position), task, progress)?))
        };
        run_alone(py, &mut Progress::new(None, 0), work)
    }
}
