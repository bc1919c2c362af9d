//! Moves and turns lights that are not surfaces.

use super::set::put;
use super::steps::{Steps, rotation};
use super::{digits, part};
use crate::parse::{LightRecord, LightType, SceneRecord};
use crate::place::Place;
use crate::transform;
use crate::values::{Spanned, Vector};
use glam::{DMat3, DVec3};
use toml_edit::{Array, InlineTable, Item, TableLike, Value};

/// Significant digits of directions and turned distances.
const DIGITS: i32 = 6;

fn light<'r>(root: &'r mut Item, record: &'r SceneRecord, i: usize) -> Result<Light<'r>, String> {
    let light = record.lights.get(i).ok_or_else(|| format!("there is no light {i}"))?;
    let (place, _) = Place::find(root, &format!("lights.{i}.type"))?;
    Ok(Light {
        record: light,
        table: place.table()?,
    })
}

struct Light<'r> {
    record: &'r LightRecord,
    table: &'r mut dyn TableLike,
}

/// A point that the file must give.
fn point(given: &Option<Spanned<Vector>>, name: &str) -> Result<DVec3, String> {
    let given = given.as_ref().ok_or_else(|| format!("the light has no `{name}`"))?;
    Ok(given.get_ref().0)
}

/// `of_target`: move only the point it shines at.
pub fn translate(root: &mut Item, record: &SceneRecord, i: usize, by: DVec3, of_target: bool) -> Result<(), String> {
    let Light { record, table } = light(root, record, i)?;
    let mut moved = |given, name| {
        let point = digits::sum_of_vectors(point(given, name)?, by);
        put(table, name, digits::vector(point));
        Ok(())
    };
    match record.kind.get_ref() {
        LightType::Spot | LightType::Projector | LightType::Laser | LightType::Point
            if of_target && record.target.is_some() =>
        {
            moved(&record.target, "target")
        }
        _ if of_target => Err("only spots, projectors and lasers shine at a point".to_owned()),
        LightType::Spot | LightType::Projector => {
            moved(&record.position, "position")?;
            moved(&record.target, "target")
        }
        LightType::Point | LightType::Laser => {
            moved(&record.position, "position")?;
            match record.target {
                Some(_) => moved(&record.target, "target"),
                None => Ok(()),
            }
        }
        LightType::Directional | LightType::Environment => {
            Err("its light comes from infinitely far away: it turns, and does not move".to_owned())
        }
    }
}

pub fn turn(root: &mut Item, record: &SceneRecord, i: usize, axis: DVec3, degrees: f64) -> Result<(), String> {
    let Light { record, table } = light(root, record, i)?;
    let rotation = transform::rotation(axis.normalize_or_zero(), degrees);
    match record.kind.get_ref() {
        LightType::Point if record.ies.is_none() => Err("it shines the same to all sides".to_owned()),
        LightType::Point if record.target.is_none() && record.direction.is_none() => {
            Err("it has neither `target` nor `direction`".to_owned())
        }
        LightType::Point | LightType::Laser if record.target.is_none() => turn_direction(table, record, rotation),
        LightType::Spot | LightType::Projector | LightType::Point | LightType::Laser => {
            let position = point(&record.position, "position")?;
            let ray = point(&record.target, "target")? - position;
            let decimals = digits::decimals(ray.length(), DIGITS);
            let target = (position + rotation * ray).map(|x| digits::rounded(x, decimals));
            put(table, "target", digits::vector(target));
            Ok(())
        }
        LightType::Directional => turn_direction(table, record, rotation),
        LightType::Environment => turn_environment(table, axis, degrees),
    }
}

fn turn_direction(table: &mut dyn TableLike, record: &LightRecord, rotation: DMat3) -> Result<(), String> {
    let direction = rotation * point(&record.direction, "direction")?;
    put(table, "direction", digits::vector(digits::direction(direction, DIGITS)));
    Ok(())
}

/// By an angle for turns around y, otherwise by steps.
fn turn_environment(table: &mut dyn TableLike, axis: DVec3, degrees: f64) -> Result<(), String> {
    let about_y = axis.x == 0.0 && axis.z == 0.0;
    if !table.contains_key("transform") {
        let given = table.get("rotate_y").and_then(Item::as_value).and_then(part::number);
        if about_y {
            let sum = digits::sum(given.unwrap_or(0.0), degrees * axis.y.signum());
            put(table, "rotate_y", digits::value(digits::rounded(sum % 360.0, 9)));
            return Ok(());
        }
        let decor = table
            .get("rotate_y")
            .and_then(Item::as_value)
            .map(|value| value.decor().clone());
        table.remove("rotate_y");
        let mut steps = Array::new();
        if let Some(before) = given {
            steps.push(InlineTable::from_iter([("rotate", rotation(DVec3::Y, before))]));
        }
        let mut steps = Value::from(steps);
        if let Some(decor) = decor {
            *steps.decor_mut() = decor;
        }
        table.insert("transform", Item::Value(steps));
    }
    Steps::of(table)?.turn(axis, degrees);
    Ok(())
}
