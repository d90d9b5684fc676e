//! Errors as Python's exceptions: what the system refused is an `OSError`, a wrong argument a `ValueError`, all else a
//! `BrickwalkError`.

use brickwalk::scene::camera::CameraError;
use brickwalk::settings::SettingsError;
use brickwalk_convert::build::BuildError;
use brickwalk_convert::import::ImportError;
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::io;

pyo3::create_exception!(
    _brickwalk,
    BrickwalkError,
    PyRuntimeError,
    "A scene that is damaged, a device that fails, or a defect of brickwalk itself."
);

/// A wrong argument.
pub fn wrong(text: impl Into<String>) -> PyErr {
    PyValueError::new_err(text.into())
}

/// A failure that is not the arguments'.
pub fn failed(text: impl Into<String>) -> PyErr {
    BrickwalkError::new_err(text.into())
}

/// The error and what caused it, as one line. What a cause says again is left out.
fn told(error: &anyhow::Error) -> String {
    error.chain().fold(String::new(), |told, cause| {
        let text = cause.to_string().replace('\n', " ");
        match told.is_empty() {
            true => text,
            false if told.contains(&text) => told,
            false => format!("{told}: {text}"),
        }
    })
}

/// What the system refused, of the class that Python has for it; and the file, if it is about one.
fn refused(source: &io::Error, (text, file): (String, Option<String>)) -> PyErr {
    // Python chooses the class by these numbers, which are the same everywhere.
    let number = match source.kind() {
        io::ErrorKind::NotFound => 2,
        io::ErrorKind::PermissionDenied => 13,
        io::ErrorKind::IsADirectory => 21,
        _ => source.raw_os_error().unwrap_or(5),
    };
    match file {
        Some(file) => PyOSError::new_err((number, text, file)),
        None => PyOSError::new_err((number, text)),
    }
}

/// The exception that stands for an error.
pub fn exception(error: &anyhow::Error) -> PyErr {
    let text = told(error);
    for cause in error.chain() {
        if let Some(bricks::Error::Io { path, source, .. }) = cause.downcast_ref() {
            return refused(source, (text, Some(path.to_string_lossy().into_owned())));
        }
        if let Some(source) = cause.downcast_ref::<io::Error>() {
            return refused(source, (text, None));
        }
        let is_format = matches!(cause.downcast_ref(), Some(ImportError::Format { .. }));
        let is_setting = matches!(cause.downcast_ref(), Some(BuildError::Setting { .. }));
        if is_format || is_setting || cause.is::<SettingsError>() || cause.is::<CameraError>() {
            return wrong(text);
        }
    }
    failed(text)
}
