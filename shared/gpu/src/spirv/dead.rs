//! Removes branches that a scene with these needs cannot reach, whose conditions are known at compile time. Drivers
//! inline every function before they look at conditions, so dead code costs them as much time as live code.

use naga::{
    Arena, Block, Constant, Expression, Function, Handle, Literal, LocalVariable, Module, Statement, UnaryOperator,
};
use std::collections::BTreeMap;

/// Removes all such branches.
pub(super) fn leave_out(module: &mut Module) {
    let (constants, values) = (&module.constants, &module.global_expressions);
    let functions = module.functions.iter_mut().map(|(_, function)| function);
    let entries = module.entry_points.iter_mut().map(|entry| &mut entry.function);
    for function in functions.chain(entries) {
        // Named expressions would be kept.
        function.named_expressions.clear();
        loop {
            let fixed = fixed(function, constants, values);
            let known = Known {
                function,
                constants,
                values,
                fixed,
            };
            let (body, is_changed) = known.living(&function.body);
            function.body = body;
            if !is_changed {
                break;
            }
        }
    }
}

/// Known values of conditions.
struct Known<'a> {
    function: &'a Function,
    constants: &'a Arena<Constant>,
    values: &'a Arena<Expression>,
    /// Variables that only ever get one value.
    fixed: BTreeMap<Handle<LocalVariable>, bool>,
}

/// Among the variables that naga makes for `&&` and `||`, which are written before they are read: those that get the
/// same value at every assignment.
fn fixed(
    function: &Function,
    constants: &Arena<Constant>,
    values: &Arena<Expression>,
) -> BTreeMap<Handle<LocalVariable>, bool> {
    let mut known = Known {
        function,
        constants,
        values,
        fixed: BTreeMap::new(),
    };
    let mut given: BTreeMap<Handle<LocalVariable>, Option<bool>> = BTreeMap::new();
    each(&function.body, &mut |statement| match statement {
        Statement::Store { pointer, value } => {
            if let Expression::LocalVariable(variable) = function.expressions[*pointer] {
                let value = known.value(*value);
                let all = given.entry(variable).or_insert(value);
                *all = all.filter(|all| Some(*all) == value);
            }
        }
        Statement::Call { arguments, .. } => {
            for argument in arguments {
                if let Expression::LocalVariable(variable) = function.expressions[*argument] {
                    given.insert(variable, None);
                }
            }
        }
        _ => {}
    });
    let is_made = |variable: Handle<LocalVariable>| {
        let variable = &function.local_variables[variable];
        variable.name.is_none() && variable.init.is_none()
    };
    known.fixed = (given.into_iter())
        .filter_map(|(variable, value)| Some((variable, value.filter(|_| is_made(variable))?)))
        .collect();
    known.fixed
}

/// Calls `f` for all statements, nested ones included.
fn each(block: &Block, f: &mut impl FnMut(&Statement)) {
    for statement in block {
        f(statement);
        match statement {
            Statement::Block(block) => each(block, f),
            Statement::If { accept, reject, .. } => {
                each(accept, f);
                each(reject, f);
            }
            Statement::Switch { cases, .. } => cases.iter().for_each(|case| each(&case.body, f)),
            Statement::Loop { body, continuing, .. } => {
                each(body, f);
                each(continuing, f);
            }
            _ => {}
        }
    }
}

impl Known<'_> {
    fn value(&self, expression: Handle<Expression>) -> Option<bool> {
        let literal = |expression: &Expression| match expression {
            Expression::Literal(Literal::Bool(value)) => Some(*value),
            _ => None,
        };
        match &self.function.expressions[expression] {
            Expression::Constant(constant) => literal(&self.values[self.constants[*constant].init]),
            Expression::Unary {
                op: UnaryOperator::LogicalNot,
                expr,
            } => self.value(*expr).map(|value| !value),
            Expression::Load { pointer } => match &self.function.expressions[*pointer] {
                Expression::LocalVariable(variable) => self.fixed.get(variable).copied(),
                _ => None,
            },
            other => literal(other),
        }
    }

    /// A block without its dead parts, and whether there were any.
    fn living(&self, block: &Block) -> (Block, bool) {
        let mut is_changed = false;
        let mut inner = |block: &Block| {
            let (block, was_changed) = self.living(block);
            is_changed |= was_changed;
            block
        };
        let mut all = Block::with_capacity(block.len());
        let mut dead = false;
        for (statement, span) in block.span_iter() {
            let mut statement = statement.clone();
            match &mut statement {
                Statement::Block(block) => *block = inner(block),
                Statement::If {
                    condition,
                    accept,
                    reject,
                } => {
                    let (accepted, rejected) = (inner(accept), inner(reject));
                    if let Some(holds) = self.value(*condition) {
                        dead = true;
                        let mut taken = if holds { accepted } else { rejected };
                        all.append(&mut taken);
                        if all.last().is_some_and(Statement::is_terminator) {
                            break;
                        }
                        continue;
                    }
                    (*accept, *reject) = (accepted, rejected);
                }
                Statement::Switch { cases, .. } => {
                    for case in cases {
                        case.body = inner(&case.body);
                    }
                }
                Statement::Loop { body, continuing, .. } => {
                    *body = inner(body);
                    *continuing = inner(continuing);
                }
                _ => {}
            }
            all.push(statement, *span);
        }
        (all, is_changed || dead)
    }
}

#[cfg(test)]
mod tests {
    use crate::spirv::{Controls, check};

    const KERNEL: &str = "
        @group(0) @binding(0) var<storage, read_write> all: array<f32>;
        @group(0) @binding(1) var<storage, read_write> others: array<f32>;
        fn costly(x: f32) -> f32 { others[0] = x; return x * x; }
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
            let x = all[i];
            all[i] = x - 1.0;
            BODY
            all[i] = x + 1.0;
        }";

    /// The number of remaining buffers, which shows whether the function is still called.
    fn buffers(constant: &str, body: &str) -> usize {
        let kernel = format!("{constant}\n{}", KERNEL.replace("BODY", body));
        let compiled = check("test", &kernel).unwrap().compile("main", Controls::default());
        compiled.unwrap().bindings.len()
    }

    #[test]
    fn what_constants_forbid_is_left_out() {
        for body in [
            "if (HAS) { all[i] = costly(x); }",
            "if (HAS && x > 0.5) { all[i] = costly(x); }",
            "if (x > 0.5 && HAS) { all[i] = costly(x); } else if (HAS) { all[0] = costly(0.0); }",
            "if (!(!HAS || x > 0.5)) { all[i] = costly(x); }",
            "if (!HAS) { return; } all[i] = costly(x);",
            "if (x > 0.5) { if (!HAS) { return; } all[i] = costly(x); }",
            "for (var k = 0u; k < 4u; k++) { if (!HAS) { break; } all[i] = costly(x); }",
            "let both = HAS && costly(x) > 0.0; if (both) { all[i] = 1.0; }",
            "if (HAS || OTHER) { if (HAS) { all[i] = costly(x); } }",
        ] {
            let of = |has: bool| buffers(&format!("const HAS = {has};\nconst OTHER: bool = true;"), body);
            assert_eq!([of(true), of(false)], [2, 1], "{body}");
        }
    }

    #[test]
    fn what_may_be_is_kept() {
        for body in [
            "if (x > 0.5) { all[i] = costly(x); }",
            "var is_late: bool; if (x > 0.5) { is_late = true; } if (!is_late) { all[i] = costly(x); }",
            "var is_there = true; if (x > 0.5) { is_there = false; } if (is_there) { all[i] = costly(x); }",
            "if (HAS && x > 0.5) { all[1] = x; } else { all[i] = costly(x); }",
            "if (!HAS || x > 0.5) { all[i] = costly(x); }",
            "switch u32(x) { case 0u: { if (HAS) { all[1] = x; } } default: { all[i] = costly(x); } }",
        ] {
            assert_eq!(buffers("const HAS = false;", body), 2, "{body}");
        }
    }
}
