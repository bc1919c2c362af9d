//! Moves and turns shapes and their instances.

use super::digits;
use super::set::put;
use super::steps::Steps;
use crate::parse::{self, SceneRecord, ShapeRecord, ShapeType};
use crate::place::Place;
use crate::transform;
use crate::values::{Spanned, Vector};
use glam::{DAffine3, DVec3};
use toml_edit::{Item, TableLike};

/// Significant digits of turned points.
const DIGITS: i32 = 7;
/// Relative distance below which points are equal; larger than the rounding.
const SAME: f64 = 1e-5;
/// Distances below this are zero.
const NONE: f64 = 1e-12;

fn shape(record: &SceneRecord, i: usize) -> Result<&ShapeRecord, String> {
    record.shapes.get(i).ok_or_else(|| format!("there is no shape {i}"))
}

fn table(root: &mut Item, i: usize) -> Result<&mut dyn TableLike, String> {
    let (place, _) = Place::find(root, &format!("shapes.{i}.type"))?;
    place.table()
}

/// The instances of a shape, and those that an id names: one or all.
fn copies(record: &ShapeRecord, copy: Option<usize>) -> Result<Vec<(usize, &parse::Steps)>, String> {
    let all = record
        .transforms
        .as_ref()
        .map(|all| all.get_ref().as_slice())
        .unwrap_or_default();
    let steps = all.iter().map(|steps| steps.get_ref()).enumerate();
    let chosen: Vec<_> = steps.filter(|(i, _)| copy.is_none_or(|copy| copy == *i)).collect();
    match (copy, chosen.is_empty()) {
        (Some(copy), true) => Err(format!("there is no copy {copy} of it")),
        _ => Ok(chosen),
    }
}

fn copy_steps(root: &mut Item, i: usize, copy: usize) -> Result<Steps<'_>, String> {
    let (place, name) = Place::find(root, &format!("shapes.{i}.transforms.{copy}"))?;
    Steps::of_value(place.value(&name).ok_or("its transform is no list")?)
}

pub fn translate(
    root: &mut Item,
    record: &SceneRecord,
    i: usize,
    copy: Option<usize>,
    by: DVec3,
) -> Result<(), String> {
    let record = shape(record, i)?;
    let kind = *record.kind.get_ref();
    if kind == ShapeType::Instances {
        for (copy, _) in copies(record, copy)? {
            copy_steps(root, i, copy)?.translate(by);
        }
        return Ok(());
    }
    if copy.is_some() {
        return Err("it has no copies".to_owned());
    }
    let table = table(root, i)?;
    let moved = |point| digits::vector(digits::sum_of_vectors(point, by));
    match (kind, &record.transform) {
        (ShapeType::Sphere, None) => put(table, "center", moved(middle(record))),
        (ShapeType::Cylinder, None) => {
            let [p0, p1] = ends(record);
            put(table, "p0", moved(p0));
            put(table, "p1", moved(p1));
        }
        _ => Steps::of(table)?.translate(by),
    }
    Ok(())
}

pub fn turn(
    root: &mut Item,
    record: &SceneRecord,
    i: usize,
    copy: Option<usize>,
    axis: DVec3,
    degrees: f64,
) -> Result<(), String> {
    let record = shape(record, i)?;
    if *record.kind.get_ref() == ShapeType::Instances {
        let Some(copy) = copy else {
            return Err("it is many copies: each turns by itself".to_owned());
        };
        let inner = record.shape.as_ref().map(|shape| shape.get_ref());
        let middle = inner.map_or(Ok(DVec3::ZERO), |inner| own(inner))?;
        let given = copies(record, Some(copy))?.first().map(|(_, steps)| *steps);
        return turn_steps(&mut copy_steps(root, i, copy)?, given, middle, axis, degrees);
    }
    if copy.is_some() {
        return Err("it has no copies".to_owned());
    }
    let table = table(root, i)?;
    let given = record.transform.as_ref().map(|steps| steps.get_ref());
    if *record.kind.get_ref() == ShapeType::Cylinder && given.is_none() {
        let rotation = transform::rotation(axis.normalize_or_zero(), degrees);
        let ends = ends(record);
        let middle = 0.5 * (ends[0] + ends[1]);
        let decimals = digits::decimals(ends[0].length().max(ends[1].length()), DIGITS);
        for (name, end) in ["p0", "p1"].into_iter().zip(ends) {
            let turned = middle + rotation * (end - middle);
            put(
                table,
                name,
                digits::vector(turned.map(|x| digits::rounded(x, decimals))),
            );
        }
        return Ok(());
    }
    turn_steps(&mut Steps::of(table)?, given, middle(record), axis, degrees)
}

/// The centre of the instanced shape, in the space where the instances' steps begin.
fn own(inner: &ShapeRecord) -> Result<DVec3, String> {
    let map = match &inner.transform {
        Some(steps) => transform::compose(steps.get_ref()).map_err(|fault| fault.message)?,
        None => DAffine3::IDENTITY,
    };
    Ok(map.transform_point3(middle(inner)))
}

/// Turn steps about the shape's centre as they place it. A trailing translation that ends there stays last.
fn turn_steps(
    steps: &mut Steps<'_>,
    given: Option<&parse::Steps>,
    middle: DVec3,
    axis: DVec3,
    degrees: f64,
) -> Result<(), String> {
    let map = match given {
        Some(given) => transform::compose(given).map_err(|fault| fault.message)?,
        None => DAffine3::IDENTITY,
    };
    let place = map.transform_point3(middle);
    let turns_about = steps.last_translation().unwrap_or(DVec3::ZERO);
    if place.distance(turns_about) <= SAME * place.length().max(turns_about.length()) + NONE {
        steps.turn(axis, degrees);
        return Ok(());
    }
    let pivot = digits::pointed(place, place.length(), DIGITS);
    steps.turn_about(pivot, axis, degrees);
    Ok(())
}

/// The shape's centre, in the space where its transform begins.
fn middle(record: &ShapeRecord) -> DVec3 {
    match record.kind.get_ref() {
        ShapeType::Cylinder => {
            let [p0, p1] = ends(record);
            0.5 * (p0 + p1)
        }
        _ => record.center.as_ref().map_or(DVec3::ZERO, |center| center.get_ref().0),
    }
}

fn ends(record: &ShapeRecord) -> [DVec3; 2] {
    let point = |given: &Option<Spanned<Vector>>, default| given.as_ref().map_or(default, |point| point.get_ref().0);
    [point(&record.p0, DVec3::ZERO), point(&record.p1, DVec3::Z)]
}
