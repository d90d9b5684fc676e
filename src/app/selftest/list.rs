//! The cases by their numbers.

use super::case::Source::{Analytic, Exact, Paths, Reference, Unit};
use super::case::{Case, Checks, Source};
use super::lab::Lab;
use super::{meshes, shapes};
use anyhow::Result;

const fn case(number: u32, title: &'static str, truth: Source, run: fn(&mut Lab) -> Result<Checks>) -> Case {
    Case { number, title, truth, run: Some(run) }
}

const fn later(number: u32, title: &'static str, truth: Source) -> Case {
    Case { number, title, truth, run: None }
}

/// All sixty.
pub const CASES: &[Case] = &[
    case(1, "scene at 10^7 m", Paths, meshes::far_origin),
    case(2, "edges shared by two bricks", Exact, meshes::cuts),
    case(3, "sizes from 10^-4 to 10^6 in one scene", Reference, meshes::scale_mix),
    case(4, "scales from 10^-12 to 10^12", Paths, meshes::scale_sweep),
    case(5, "slivers, aspect 10^8", Exact, meshes::slivers),
    case(6, "zero area", Unit, shapes::zero_area),
    case(7, "vertices that are not finite", Unit, shapes::not_finite),
    case(8, "denormals", Paths, meshes::denormals),
    case(9, "overflow near 10^38", Unit, shapes::overflow),
    case(10, "coincident triangles", Paths, shapes::coincident),
    case(11, "all centroids equal", Unit, shapes::equal_centroids),
    case(12, "a million duplicates", Unit, shapes::duplicates),
    case(13, "triangles that span every brick", Reference, shapes::spanning),
    case(14, "a geometric series, very deep trees", Reference, shapes::series),
    case(20, "edges and vertices of closed meshes", Exact, meshes::edges),
    case(23, "rays that graze at 10^-7 rad", Reference, meshes::grazing),
    case(38, "empty scene, one triangle, one brick", Analytic, shapes::least_scenes),
    later(41, "ROMA: t = 0, 31, 32, where words join", Reference),
    later(42, "ROMA: origin outside, ray that leaves", Reference),
    case(43, "flat scene", Unit, shapes::flat_scene),
    later(47, "DVF: empty cell, point on a face", Unit),
    later(48, "prefix sum over 3M areas from 10^-12 to 10^6", Reference),
    later(49, "spherical harmonics of a delta light", Analytic),
    later(50, "texel of the sun, 10^6", Analytic),
    later(51, "E_all - E_occ in a closed box", Analytic),
    later(52, "NaN in the history", Unit),
    later(53, "running variance: mean 10^8, sigma 1", Analytic),
    later(54, "10^6 accumulated frames", Analytic),
    later(56, "distances in f16", Reference),
    later(57, "jump flooding without a seed", Unit),
    later(58, "displacement field: inside, tangent, miss", Analytic),
    case(59, "uneven scale of instances", Reference, meshes::instances),
];
