//! Reads files: includes, ids, aliases, references.

use super::parameters::{MAX_ATTRIBUTE, Parameter, Substitution, substitute};
use super::upgrade;
use super::{Content, Id, Kind, Member, Object, Objects};
use crate::mitsuba::FileLine;
use crate::mitsuba::attributes::{self, Attributes};
use crate::mitsuba::log::Log;
use crate::mitsuba::transform::{self, Step};
use crate::mitsuba::value::{self, Value};
use crate::reach::{Reach, Written};
use roxmltree::{Document, Node};
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The deepest nesting of elements. Mitsuba's own scenes use about six levels.
pub const MAX_DEPTH: usize = 100;
/// The most elements in all files together; includes can multiply them.
const MAX_ELEMENTS: usize = 10_000_000;
/// The most attributes of an element. Mitsuba's elements have about six.
const MOST_ATTRIBUTES: usize = 100;
/// The deepest nesting of includes (Mitsuba's own limit).
const MAX_INCLUDES: usize = 15;
/// The most files, counted each time they are included.
const MAX_FILES: usize = 10_000;

/// A reference to be resolved once all ids are known.
struct Reference {
    object: Id,
    member: usize,
    id: String,
}

struct Reader<'a> {
    objects: Objects,
    reach: &'a Reach,
    log: &'a mut Log,
    ids: BTreeMap<String, Id>,
    /// Member names by owner.
    names: BTreeSet<(Id, String)>,
    references: Vec<Reference>,
    /// Longest names first, so that $ab is not taken for $a.
    parameters: Vec<Parameter>,
    elements: usize,
    /// The files being read, each included by the previous one.
    open: Vec<PathBuf>,
    /// Whether each file is of a version before 2.
    old: Vec<bool>,
}

/// Read a scene. `None` if nothing can be read; the log says why.
pub fn read(path: &Path, given: &[(String, String)], reach: &Reach, log: &mut Log) -> Option<Objects> {
    let mut parameters: Vec<Parameter> = Vec::new();
    for (name, value) in given {
        parameters.retain(|p| p.name != *name);
        parameters.push(Parameter {
            name: name.clone(),
            value: value.clone(),
            used: false,
        });
    }
    parameters.sort_by_key(|p| std::cmp::Reverse(p.name.len()));
    let mut reader = Reader {
        objects: Objects {
            list: Vec::new(),
            folders: Vec::new(),
        },
        reach,
        log,
        ids: BTreeMap::new(),
        names: BTreeSet::new(),
        references: Vec::new(),
        parameters,
        elements: 0,
        open: Vec::new(),
        old: Vec::new(),
    };
    let done = reader.file(path, None);
    for parameter in reader.parameters.iter().filter(|p| !p.used) {
        let message = format!(
            "the parameter {} of -D is not used: no attribute says ${}",
            parameter.name, parameter.name
        );
        reader.log.invalid(None, message);
    }
    done?;
    reader.resolve_references()?;
    reader.objects.upgrade();
    Some(reader.objects)
}

/// The object that an element's content belongs to.
#[derive(Clone, Copy)]
struct Parent {
    object: Option<Id>,
    depth: usize,
}

/// An element being read, with its attributes after substitution.
struct Element<'a, 'xml> {
    node: Node<'a, 'xml>,
    tag: &'a str,
    /// Its member name in the parent.
    name: Option<&'a str>,
    attributes: &'a Attributes,
    place: FileLine,
}

impl<'a> Element<'a, '_> {
    fn attribute(&self, name: &str) -> Option<&'a str> {
        self.attributes.get(name).map(String::as_str)
    }
}

impl Reader<'_> {
    /// Read a file. `parent`: the object that includes it, and the include's name.
    fn file(&mut self, path: &Path, parent: Option<(Parent, Option<&str>, FileLine)>) -> Option<()> {
        let from = parent.as_ref().map(|(_, _, place)| *place);
        let canonical = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        if self.open.contains(&canonical) {
            let chain: Vec<String> = self.open.iter().map(|p| p.display().to_string()).collect();
            let message = format!(
                "the file {} includes itself, by way of {}",
                path.display(),
                chain.join(", ")
            );
            return self.log.fatal(from, message);
        }
        if self.open.len() > MAX_INCLUDES {
            let message = format!("more than {MAX_INCLUDES} files included within each other");
            return self.log.fatal(from, message);
        }
        if self.log.files.len() == MAX_FILES {
            let message = format!("more than {MAX_FILES} files, counted as often as they are included");
            return self.log.fatal(from, message);
        }
        let most = beamfarm_image::bundle::MAX_BYTES;
        let bytes = match from {
            Some(place) => self.reach.read(path, most, place.author()),
            None => crate::disk::read_file(path, most),
        };
        let bytes = match bytes {
            Ok(bytes) => bytes,
            Err(reason) if from.is_some() => {
                let message = format!("the file \"{}\": {reason}", path.display());
                return self.log.fatal(from, message);
            }
            Err(reason) => return self.log.fatal(None, reason),
        };
        let file = self.log.files.len();
        self.log.files.push(path.to_path_buf());
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        let mut folders = vec![folder];
        if let Some(place) = from {
            folders.extend(self.objects.folders[place.file].iter().cloned());
        }
        self.objects.folders.push(folders);
        let top = FileLine { file, line: 1 };
        let Ok(text) = std::str::from_utf8(&bytes) else {
            return self.log.fatal(Some(top), "the file is not UTF-8 text");
        };
        // The parser compares all pairs of an element's attributes.
        if let Some(at) = attributes::beyond(text, MOST_ATTRIBUTES) {
            let line = beamfarm_assets::line_of(text.as_bytes(), at);
            let message = format!("an element has more than {MOST_ATTRIBUTES} attributes");
            return self.log.fatal(Some(FileLine { file, line }), message);
        }
        // Without document types there are no custom entities that could expand.
        let document = match Document::parse(text) {
            Ok(document) => document,
            Err(error) => {
                let line = error.pos().row as usize;
                let message = match error {
                    roxmltree::Error::DtdDetected => {
                        "document types (<!DOCTYPE ...>) and entities of one's own are not supported".to_string()
                    }
                    error => format!("not well-formed XML: {error}"),
                };
                return self.log.fatal(Some(FileLine { file, line }), message);
            }
        };
        let lines = Lines::new(text);
        let root = document.root_element();
        let place = FileLine {
            file,
            line: lines.line(root.range().start),
        };
        let old = is_old(root, place, self.log);
        self.old.push(old);
        self.open.push(canonical);
        let context = File { file, lines: &lines };
        let done = match (parent, root.tag_name().name()) {
            // An included scene's content goes directly into the including object.
            (Some((parent, ..)), "scene") => self.children(root, parent, &context),
            (Some((parent, name, _)), _) => self.element(root, parent, name, &context),
            (None, "scene") => {
                let none = Parent { object: None, depth: 0 };
                self.element(root, none, None, &context)
            }
            (None, other) => self
                .log
                .fatal(Some(place), format!("expected <scene>, found <{other}>")),
        };
        self.open.pop();
        done
    }

    fn children(&mut self, node: Node<'_, '_>, parent: Parent, file: &File<'_>) -> Option<()> {
        for child in node.children().filter(Node::is_element) {
            self.element(child, parent, None, file)?;
        }
        Some(())
    }

    /// Read an element into its parent. `None` aborts the reading.
    fn element(&mut self, node: Node<'_, '_>, parent: Parent, name: Option<&str>, file: &File<'_>) -> Option<()> {
        let place = file.place(node);
        self.count(parent.depth, place)?;
        let attributes = self.attributes(node, place)?;
        let name = name.or(attributes.get("name").map(String::as_str));
        let element = Element {
            node,
            tag: node.tag_name().name(),
            name: name.filter(|name| !name.is_empty()),
            attributes: &attributes,
            place,
        };
        // A spectrum with a type is an object.
        let kind = match element.tag {
            "spectrum" if element.attribute("type").is_some() => Some(Kind::Texture),
            // The names in versions before 0.5.
            "camera" if self.old[place.file] => Some(Kind::Sensor),
            "luminaire" if self.old[place.file] => Some(Kind::Emitter),
            tag => Kind::of_tag(tag),
        };
        match (kind, parent.object) {
            (Some(kind), _) => self.object(&element, kind, parent, file),
            (None, None) => Some(()),
            (None, Some(owner)) => match element.tag {
                "default" => self.default_element(&element),
                "include" => self.include(&element, parent),
                "path" => self.path(&element),
                "alias" => self.alias(&element),
                "ref" => self.reference(&element, owner),
                _ => self.property(&element, owner, parent.depth, file),
            },
        }
    }

    fn object(&mut self, element: &Element<'_, '_>, kind: Kind, parent: Parent, file: &File<'_>) -> Option<()> {
        let &Element { node, tag, place, .. } = element;
        let known: &[&str] = match kind {
            Kind::Scene => &["version", "id", "name"],
            _ => &["type", "id", "name", "version"],
        };
        self.known(element, known);
        let plugin = element.attribute("type");
        let Some(plugin) = plugin.or((kind == Kind::Scene).then_some("scene")) else {
            self.log
                .invalid(Some(place), format!("<{tag}> lacks the attribute \"type\""));
            return Some(());
        };
        let object = self.objects.list.len();
        self.objects.list.push(Object {
            kind,
            plugin: plugin.to_string(),
            id: element.attribute("id").map(str::to_string),
            place,
            members: Vec::new(),
            old: self.old[place.file],
        });
        if let Some(id) = element.attribute("id") {
            self.define(id, object, place);
        }
        if let Some(owner) = parent.object {
            self.add(owner, element.name, place, Content::Object(object));
        }
        let inner = Parent {
            object: Some(object),
            depth: parent.depth + 1,
        };
        self.children(node, inner, file)
    }

    fn default_element(&mut self, element: &Element<'_, '_>) -> Option<()> {
        self.known(element, &["name", "value"]);
        match (element.attribute("name"), element.attribute("value")) {
            (Some(name), Some(value)) if !name.is_empty() => self.default(name, value),
            _ => self.log.invalid(
                Some(element.place),
                "<default> takes the attributes \"name\" and \"value\"",
            ),
        }
        Some(())
    }

    fn include(&mut self, element: &Element<'_, '_>, parent: Parent) -> Option<()> {
        self.known(element, &["filename", "name"]);
        let place = element.place;
        let Some(written) = element.attribute("filename") else {
            let message = "<include> lacks the attribute \"filename\"";
            self.log.invalid(Some(place), message);
            return Some(());
        };
        let path = self.objects.resolve(place, written);
        self.file(&path, Some((parent, element.name, place)))
    }

    fn path(&mut self, element: &Element<'_, '_>) -> Option<()> {
        self.known(element, &["value"]);
        let place = element.place;
        if let Some(value) = element.attribute("value") {
            let folder = self.objects.resolve(place, value);
            if !folder.is_dir() {
                let message = format!("the folder \"{value}\" was not found");
                self.log.invalid(Some(place), message);
            }
            if place.author() == Written::ByUser {
                self.reach.allow(&folder);
            }
            self.objects.folders[place.file].insert(0, folder);
        }
        Some(())
    }

    fn alias(&mut self, element: &Element<'_, '_>) -> Option<()> {
        self.known(element, &["id", "as"]);
        let place = element.place;
        let object = element.attribute("id").and_then(|id| self.ids.get(id));
        match (object, element.attribute("as")) {
            (Some(object), Some(new)) => self.define(new, *object, place),
            _ => self.log.invalid(
                Some(place),
                "<alias> takes the attributes \"id\", which names an object above, and \"as\"",
            ),
        }
        Some(())
    }

    fn reference(&mut self, element: &Element<'_, '_>, owner: Id) -> Option<()> {
        self.known(element, &["id", "name"]);
        let place = element.place;
        let Some(id) = element.attribute("id") else {
            let message = "<ref> lacks the attribute \"id\"";
            self.log.invalid(Some(place), message);
            return Some(());
        };
        self.references.push(Reference {
            object: owner,
            member: self.objects.list[owner].members.len(),
            id: id.to_string(),
        });
        // Its target is resolved once all ids are known.
        self.add(owner, element.name, place, Content::Object(owner));
        Some(())
    }

    fn property(&mut self, element: &Element<'_, '_>, owner: Id, depth: usize, file: &File<'_>) -> Option<()> {
        let &Element {
            node, tag, name, place, ..
        } = element;
        let value = match tag {
            "transform" => {
                self.known(element, &["name"]);
                self.transform(node, depth + 1, file)?
            }
            "spectrum" if element.attributes.contains_key("filename") => {
                self.known(element, &["name", "filename"]);
                self.spectrum_file(element)
            }
            _ => value::parse(tag, element.attributes, self.old[place.file]),
        };
        let value = match (value, name) {
            (Ok(value), Some(_)) => value,
            (Ok(_), None) => {
                let message = format!("<{tag}> lacks the attribute \"name\"");
                self.log.invalid(Some(place), message);
                return Some(());
            }
            (Err(message), name) => {
                let message = match name {
                    Some(name) => format!("{name}: {message}"),
                    None => message,
                };
                self.log.invalid(Some(place), message);
                return Some(());
            }
        };
        if tag != "transform"
            && let Some(child) = node.children().find(Node::is_element)
        {
            let inner = child.tag_name().name();
            let message = format!("<{inner}> cannot stand within <{tag}>");
            self.log.invalid(Some(file.place(child)), message);
        }
        self.add(owner, name, place, Content::Value(value));
        Some(())
    }

    /// A spectrum file: a wavelength and a value per line.
    fn spectrum_file(&self, element: &Element<'_, '_>) -> Result<Value, String> {
        let written = element.attribute("filename").unwrap_or_default();
        let path = self.objects.resolve(element.place, written);
        let within = |reason: String| format!("the file \"{written}\": {reason}");
        let most = beamfarm_image::bundle::MAX_BYTES;
        let bytes = self.reach.read(&path, most, element.place.author()).map_err(within)?;
        value::spectrum_table(&String::from_utf8_lossy(&bytes)).map_err(within)
    }

    fn add(&mut self, owner: Id, name: Option<&str>, place: FileLine, content: Content) {
        let name = name.map(|name| match self.old[place.file] {
            true => upgrade::name(&self.objects.list[owner].plugin, name),
            false => name.to_string(),
        });
        let name = name.as_deref();
        if let Some(name) = name
            && !self.names.insert((owner, name.to_string()))
        {
            let message = format!("\"{name}\" is given twice");
            match self.old[place.file] {
                // Versions before 2 warned and used the last one.
                true => self.log.note(place, message),
                false => self.log.invalid(Some(place), message),
            }
        }
        let members = &mut self.objects.list[owner].members;
        members.push(Member {
            name: name.map(str::to_string),
            place,
            content,
            used: Cell::new(false),
        });
    }

    /// The steps of a transform. The outer `None` aborts the reading.
    fn transform(&mut self, node: Node<'_, '_>, depth: usize, file: &File<'_>) -> Option<Result<Value, String>> {
        let mut steps = Vec::new();
        for child in node.children().filter(Node::is_element) {
            let place = file.place(child);
            self.count(depth, place)?;
            let attributes = self.attributes(child, place)?;
            let tag = child.tag_name().name();
            match transform::step(tag, &attributes, self.old[place.file]) {
                Ok(step) => {
                    if tag == "rotate" && matches!(step, Step::Matrix(_)) && !self.old[place.file] {
                        let message = "<rotate>: its axis is not of unit length, so that it scales and shears, as it does in \
                            Mitsuba 3";
                        self.log.note(place, message);
                    }
                    steps.push(step);
                }
                Err(message) => self.log.invalid(Some(place), message),
            }
        }
        Some(Ok(Value::Transform(steps)))
    }

    fn count(&mut self, depth: usize, place: FileLine) -> Option<()> {
        self.elements += 1;
        if depth >= MAX_DEPTH {
            let message = format!("more than {MAX_DEPTH} elements within each other");
            return self.log.fatal(Some(place), message);
        }
        if self.elements > MAX_ELEMENTS {
            let message = format!("more than {MAX_ELEMENTS} elements, those of included files among them");
            return self.log.fatal(Some(place), message);
        }
        Some(())
    }

    fn known(&mut self, element: &Element<'_, '_>, known: &[&str]) {
        let Element { tag, place, .. } = element;
        let names = element.attributes.keys();
        for name in names.filter(|name| !known.contains(&name.as_str())) {
            let message = format!("<{tag}> does not take the attribute \"{name}\"");
            self.log.invalid(Some(*place), message);
        }
    }

    fn define(&mut self, id: &str, object: Id, place: FileLine) {
        if let Some(before) = self.ids.get(id) {
            let before = self.log.describe(self.objects.list[*before].place);
            let message = format!("the id \"{id}\" stands for something else already, at {before}");
            self.log.invalid(Some(place), message);
        } else {
            self.ids.insert(id.to_string(), object);
        }
    }

    fn default(&mut self, name: &str, value: &str) {
        if self.parameters.iter().any(|p| p.name == name) {
            return;
        }
        let at = self.parameters.partition_point(|p| p.name.len() >= name.len());
        let parameter = Parameter {
            name: name.to_string(),
            value: value.to_string(),
            used: true,
        };
        self.parameters.insert(at, parameter);
    }

    /// The attributes after substitution. `None` aborts the reading.
    fn attributes(&mut self, node: Node<'_, '_>, place: FileLine) -> Option<Attributes> {
        let mut attributes = Attributes::new();
        for attribute in node.attributes() {
            let value = match attribute.value().contains('$') {
                false => attribute.value().to_string(),
                true => match substitute(attribute.value(), &mut self.parameters) {
                    Ok(value) => value,
                    Err(Substitution::TooLong) => {
                        let message = format!(
                            "the attribute \"{}\" has more than {MAX_ATTRIBUTE} bytes once its parameters are replaced",
                            attribute.name()
                        );
                        return self.log.fatal(Some(place), message);
                    }
                    Err(Substitution::Unknown(name)) => {
                        let message = format!(
                            "the parameter ${name} is not defined; give it by -D {name}=value, or a <default> above"
                        );
                        self.log.invalid(Some(place), message);
                        continue;
                    }
                },
            };
            attributes.insert(attribute.name().to_string(), value);
        }
        Some(attributes)
    }

    fn resolve_references(&mut self) -> Option<()> {
        let mut complete = true;
        for reference in &self.references {
            let member = &mut self.objects.list[reference.object].members[reference.member];
            match self.ids.get(&reference.id) {
                Some(object) => member.content = Content::Object(*object),
                None => {
                    complete = false;
                    let message = format!("there is no object with the id \"{}\"", reference.id);
                    self.log.invalid(Some(member.place), message);
                }
            }
        }
        // Everything after this walks the objects and must terminate.
        let complete = complete.then_some(());
        complete.and_then(|()| self.objects.refuse_cycles(self.log))
    }
}

/// Whether a file is of a version before 2, with other names.
fn is_old(root: Node<'_, '_>, place: FileLine, log: &mut Log) -> bool {
    let Some(version) = root.attribute("version") else {
        log.invalid(
            Some(place),
            "the attribute \"version\" is missing; expected version=\"3.0.0\" or another of Mitsuba's",
        );
        return false;
    };
    let major = version.split('.').next().and_then(|n| n.trim().parse::<u32>().ok());
    if !matches!(major, Some(0..=3)) {
        let message = format!("version \"{version}\" of the format is not supported; expected 0 to 3");
        log.invalid(Some(place), message);
    }
    matches!(major, Some(0 | 1))
}

struct File<'a> {
    file: usize,
    lines: &'a Lines,
}

impl File<'_> {
    fn place(&self, node: Node<'_, '_>) -> FileLine {
        FileLine {
            file: self.file,
            line: self.lines.line(node.range().start),
        }
    }
}

/// Byte offsets of line starts, so that a look-up need not scan the file.
struct Lines(Vec<usize>);

impl Lines {
    fn new(text: &str) -> Self {
        let starts = text.bytes().enumerate().filter(|(_, b)| *b == b'\n');
        Self(starts.map(|(i, _)| i + 1).collect())
    }
    fn line(&self, byte: usize) -> usize {
        1 + self.0.partition_point(|start| *start <= byte)
    }
}
