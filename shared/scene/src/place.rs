//! Write access to a place in a scene file's text by its path (`camera.fov`, `lights.0.power`).

use toml_edit::{InlineTable, Item, Key, TableLike, Value};

/// A part of the file that contains others.
pub enum Place<'a> {
    Item(&'a mut Item),
    Value(&'a mut Value),
    Table(&'a mut toml_edit::Table),
}

/// The names in a path.
pub fn names(path: &str) -> Result<Vec<String>, String> {
    let keys = Key::parse(path).map_err(|_| "expected a path as in camera.fov or lights.0.power".to_owned())?;
    Ok(keys.into_iter().map(|key| key.get().to_owned()).collect())
}

/// Put a value into a table; it inherits the formatting of the value it replaces.
pub fn put(table: &mut dyn TableLike, name: &str, mut value: Value) {
    if let Some(before) = table.get(name).and_then(Item::as_value) {
        *value.decor_mut() = before.decor().clone();
    }
    table.insert(name, Item::Value(value));
}

fn index(name: &str) -> Result<usize, String> {
    let expected = "expected the number of one of a list";
    name.parse().map_err(|_| expected.to_owned())
}

fn beyond(count: usize) -> String {
    format!("there are {count}, numbered from 0")
}

impl<'a> Place<'a> {
    /// The parent of a path's last name, with that name. Missing tables are created.
    pub fn find(root: &'a mut Item, path: &str) -> Result<(Self, String), String> {
        let mut names = names(path)?;
        let last = names.pop().ok_or("expected a path")?;
        let mut place = Place::Item(root);
        let mut so_far = String::new();
        for name in names {
            so_far += &format!("{}{name}", if so_far.is_empty() { "" } else { "." });
            place = place.enter(&name).map_err(|why| format!("{so_far}: {why}"))?;
        }
        Ok((place, last))
    }

    fn enter(self, key: &str) -> Result<Self, String> {
        match self {
            Self::Item(Item::ArrayOfTables(list)) => {
                let count = list.len();
                list.get_mut(index(key)?).map(Self::Table).ok_or_else(|| beyond(count))
            }
            Self::Item(Item::Value(value)) | Self::Value(value) => match value {
                Value::Array(list) => {
                    let count = list.len();
                    list.get_mut(index(key)?).map(Self::Value).ok_or_else(|| beyond(count))
                }
                Value::InlineTable(table) => {
                    let inner = table.entry(key).or_insert_with(|| InlineTable::new().into());
                    Ok(Self::Value(inner))
                }
                _ => Err("it is a value and no table".to_owned()),
            },
            Self::Item(item) => match item.as_table_mut() {
                Some(table) => Ok(Self::Table(table)).and_then(|table| table.enter(key)),
                None => Err("it is no table".to_owned()),
            },
            Self::Table(table) => Ok(Self::Item(table.entry(key).or_insert_with(toml_edit::table))),
        }
    }

    /// Put a value under a name, or at a list index.
    pub fn set(self, key: &str, value: Value) -> Result<(), String> {
        match self {
            Self::Item(Item::Value(Value::Array(list))) | Self::Value(Value::Array(list)) => {
                let count = list.len();
                let place = list.get_mut(index(key)?).ok_or_else(|| beyond(count))?;
                let decor = std::mem::take(place.decor_mut());
                *place = value;
                *place.decor_mut() = decor;
                Ok(())
            }
            other => {
                put(other.table()?, key, value);
                Ok(())
            }
        }
    }

    /// This place as a table.
    pub fn table(self) -> Result<&'a mut dyn TableLike, String> {
        match self {
            Self::Item(item) => item.as_table_like_mut().ok_or_else(|| "it is no table".to_owned()),
            Self::Value(Value::InlineTable(table)) => Ok(table),
            Self::Value(_) => Err("it is a value and no table".to_owned()),
            Self::Table(table) => Ok(table),
        }
    }

    /// The value of a name, or at a list index.
    pub fn value(self, key: &str) -> Option<&'a mut Value> {
        match self {
            Self::Item(Item::Value(Value::Array(list))) | Self::Value(Value::Array(list)) => {
                list.get_mut(index(key).ok()?)
            }
            other => other.table().ok()?.get_mut(key)?.as_value_mut(),
        }
    }
}
