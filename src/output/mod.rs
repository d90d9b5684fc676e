//! The files a command leaves behind. All of them appear complete or not at all, except [`atomic::JsonLines`], which
//! grows by whole lines.

pub mod arrays;
pub mod atomic;
pub mod exr;
pub mod leftovers;
pub mod npy;
pub mod png;
pub mod srgb;
pub mod video;
