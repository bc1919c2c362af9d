//! Parameters: `$name` in attributes.

/// The most bytes of an attribute after substitution: nested parameters can grow exponentially.
pub const MAX_ATTRIBUTE: usize = 1 << 20;

/// A parameter: `$name` in attributes stands for its value.
pub struct Parameter {
    pub name: String,
    pub value: String,
    pub used: bool,
}

/// Why a substitution failed.
pub enum Substitution {
    TooLong,
    Unknown(String),
}

/// Replace every `$name`; `\$` is a literal dollar sign.
pub fn substitute(text: &str, parameters: &mut [Parameter]) -> Result<String, Substitution> {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find('$') {
        let (before, after) = (&rest[..at], &rest[at + 1..]);
        if let Some(before) = before.strip_suffix('\\') {
            out.push_str(before);
            out.push('$');
            rest = after;
            continue;
        }
        out.push_str(before);
        let Some(parameter) = parameters.iter_mut().find(|p| after.starts_with(&p.name)) else {
            let end = after.find(|c: char| !c.is_alphanumeric() && c != '_');
            let name = &after[..end.unwrap_or(after.len())];
            return Err(Substitution::Unknown(name.to_string()));
        };
        parameter.used = true;
        out.push_str(&parameter.value);
        rest = &after[parameter.name.len()..];
        if out.len() > MAX_ATTRIBUTE {
            return Err(Substitution::TooLong);
        }
    }
    out.push_str(rest);
    Ok(out)
}
