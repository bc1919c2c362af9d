//! Several passes per dispatch.
//!
//! A kernel is written for one pass. Buffers of group 1 belong to the pass: they hold equal parts, one per pass of a
//! dispatch, and workgroups with number `z` use part `z`. So each access is offset by whole parts, and a buffer of one
//! value becomes a list with one value per pass. All other buffers belong to the scene.

use naga::proc::Layouter;
use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{
    AddressSpace, ArraySize, BinaryOperator, Binding, Block, BuiltIn, Expression, Function, FunctionArgument,
    GlobalVariable, Handle, Literal, Module, Range, Scalar, ScalarKind, Span, Statement, Type, TypeInner, UniqueArena,
    VectorSize,
};
use std::collections::BTreeMap;

/// The group of buffers with one part per pass.
pub(super) const OF_PASS: u32 = 1;

/// The message for a kernel that cannot be rewritten.
type Result<T> = std::result::Result<T, String>;

/// Makes each pass of a dispatch use its own part of the buffers of group 1.
pub(super) fn split(module: &mut Module, info: &ModuleInfo) -> Result<()> {
    let own: Vec<_> = (module.global_variables.iter())
        .filter(|(_, variable)| (variable.binding.as_ref()).is_some_and(|binding| binding.group == OF_PASS))
        .map(|(handle, _)| handle)
        .collect();
    if own.is_empty() {
        return Ok(());
    }
    let mut layouter = Layouter::default();
    layouter.update(module.to_ctx()).map_err(|error| error.to_string())?;
    let word = a_type(module, TypeInner::Scalar(Scalar::U32));
    let words = a_type(
        module,
        TypeInner::Vector {
            size: VectorSize::Tri,
            scalar: Scalar::U32,
        },
    );
    let private = |module: &mut Module, name: String| {
        let variable = GlobalVariable {
            name: Some(name),
            space: AddressSpace::Private,
            binding: None,
            ty: word,
            init: None,
            memory_decorations: naga::MemoryDecorations::default(),
        };
        module.global_variables.append(variable, Span::UNDEFINED)
    };
    let mut parts = BTreeMap::new();
    for variable in own {
        let GlobalVariable { name, ty, .. } = &module.global_variables[variable];
        let (name, ty) = (name.clone().unwrap_or_default(), *ty);
        let is_list = match &module.types[ty].inner {
            TypeInner::Array { size, .. } => *size == ArraySize::Dynamic,
            TypeInner::Struct { members, .. } => {
                let last = members.last().map(|member| &module.types[member.ty].inner);
                if let Some(TypeInner::Array { size, .. }) = last
                    && *size == ArraySize::Dynamic
                {
                    return Err(format!("\"{name}\" of a pass ends in a list"));
                }
                false
            }
            _ => false,
        };
        if !is_list {
            let inner = TypeInner::Array {
                base: ty,
                size: ArraySize::Dynamic,
                stride: layouter[ty].to_stride(),
            };
            module.global_variables.get_mut(variable).ty = a_type(module, inner);
        }
        let at = private(module, format!("{name}_at"));
        parts.insert(variable, Part { at, is_list });
    }
    let passes = private(module, "passes".to_owned());
    let all = Parts { parts, passes };
    let types = module.types.clone();
    for (handle, function) in module.functions.iter_mut() {
        Rewriting::new(&all, &types, &info[handle], function).run(function, Vec::new())?;
    }
    for (i, entry) in module.entry_points.iter_mut().enumerate() {
        let uses = info.get_entry_point(i);
        let used: Vec<_> = (all.parts.keys().copied())
            .filter(|variable| !uses[*variable].is_empty())
            .collect();
        let function = &mut entry.function;
        let builtins = [BuiltIn::WorkGroupId, BuiltIn::NumWorkGroups].map(|builtin| argument(function, builtin, words));
        let mut rewriting = Rewriting::new(&all, &types, uses, function);
        let first = rewriting.find_parts(&used, builtins);
        rewriting.run(function, first)?;
    }
    Ok(())
}

/// A type, reused if it exists.
fn a_type(module: &mut Module, inner: TypeInner) -> Handle<Type> {
    module.types.insert(Type { name: None, inner }, Span::UNDEFINED)
}

/// The index of the argument with a built-in value, added if missing.
fn argument(function: &mut Function, builtin: BuiltIn, ty: Handle<Type>) -> u32 {
    let binding = Some(Binding::BuiltIn(builtin));
    let known = function
        .arguments
        .iter()
        .position(|argument| argument.binding == binding);
    let place = known.unwrap_or_else(|| {
        let name = None;
        function.arguments.push(FunctionArgument { name, ty, binding });
        function.arguments.len() - 1
    });
    place as u32
}

/// A buffer with one part per pass.
#[derive(Clone, Copy)]
struct Part {
    /// Offset of the pass's part, in elements: a variable of the thread.
    at: Handle<GlobalVariable>,
    /// Whether it was a list before.
    is_list: bool,
}

struct Parts {
    parts: BTreeMap<Handle<GlobalVariable>, Part>,
    /// Number of passes: a variable of the thread.
    passes: Handle<GlobalVariable>,
}

/// A function whose expressions are rewritten in order: each may use only earlier ones.
struct Rewriting<'a> {
    all: &'a Parts,
    types: &'a UniqueArena<Type>,
    info: &'a FunctionInfo,
    old: naga::Arena<Expression>,
    new: naga::Arena<Expression>,
    /// For each old expression: the first new one made for it, and its replacement.
    places: Vec<(Handle<Expression>, Handle<Expression>)>,
    /// Offsets of parts, and the number of passes, as far as the function needs them.
    at: BTreeMap<Handle<GlobalVariable>, Handle<Expression>>,
    passes: Option<Handle<Expression>>,
    /// Constants that are added to offsets.
    literals: BTreeMap<u32, Handle<Expression>>,
}

type Statements = Vec<Statement>;

impl<'a> Rewriting<'a> {
    fn new(all: &'a Parts, types: &'a UniqueArena<Type>, info: &'a FunctionInfo, function: &mut Function) -> Self {
        let old = std::mem::take(&mut function.expressions);
        let mut rewriting = Self {
            all,
            types,
            info,
            old,
            new: naga::Arena::new(),
            places: Vec::new(),
            at: BTreeMap::new(),
            passes: None,
            literals: BTreeMap::new(),
        };
        let constants: Vec<u32> = (rewriting.old.iter())
            .filter_map(|(_, expression)| match *expression {
                Expression::AccessIndex { base, index } if rewriting.part(base)?.1.is_list => Some(index),
                _ => None,
            })
            .collect();
        for constant in constants {
            let literal = Expression::Literal(Literal::U32(constant));
            let known = rewriting.literals.get(&constant).copied();
            let literal = known.unwrap_or_else(|| rewriting.new.append(literal, Span::UNDEFINED));
            rewriting.literals.insert(constant, literal);
        }
        rewriting
    }

    /// The buffer part that an old expression refers to as a whole.
    fn part(&self, old: Handle<Expression>) -> Option<(Handle<GlobalVariable>, Part)> {
        match self.old[old] {
            Expression::GlobalVariable(variable) => self.all.parts.get(&variable).map(|part| (variable, *part)),
            _ => None,
        }
    }

    fn add(&mut self, expression: Expression) -> Handle<Expression> {
        self.new.append(expression, Span::UNDEFINED)
    }

    /// In an entry point: computes the offsets of these buffers' parts for all functions.
    fn find_parts(&mut self, used: &[Handle<GlobalVariable>], [group, groups]: [u32; 2]) -> Statements {
        let group = self.add(Expression::FunctionArgument(group));
        let groups = self.add(Expression::FunctionArgument(groups));
        let pointers: Vec<_> = (used.iter())
            .map(|variable| {
                let buffer = self.add(Expression::GlobalVariable(*variable));
                (
                    buffer,
                    self.add(Expression::GlobalVariable(self.all.parts[variable].at)),
                )
            })
            .collect();
        let pointer = self.add(Expression::GlobalVariable(self.all.passes));
        let pass = self.add(Expression::AccessIndex { base: group, index: 2 });
        let passes = self.add(Expression::AccessIndex { base: groups, index: 2 });
        let binary = |op, left, right| Expression::Binary { op, left, right };
        let mut last = passes;
        let mut stores = vec![Statement::Store { pointer, value: passes }];
        for (variable, (buffer, pointer)) in used.iter().zip(pointers) {
            let length = self.add(Expression::ArrayLength(buffer));
            let length = self.add(binary(BinaryOperator::Divide, length, passes));
            let value = self.add(binary(BinaryOperator::Multiply, length, pass));
            stores.push(Statement::Store { pointer, value });
            self.at.insert(*variable, value);
            last = value;
        }
        self.passes = Some(passes);
        let all = Statement::Emit(Range::new_from_bounds(pass, last));
        [vec![all], stores].concat()
    }

    /// In other functions: loads what the entry point has computed.
    fn load_parts(&mut self) -> Statements {
        let mut used = BTreeMap::new();
        let mut asks = false;
        for (handle, expression) in self.old.iter() {
            if let Some((variable, part)) = self.part(handle) {
                used.insert(variable, part.at);
            }
            asks |= matches!(*expression, Expression::ArrayLength(list) if self.part(list).is_some());
        }
        let mut wanted: Vec<_> = used.into_iter().map(|(variable, at)| (Some(variable), at)).collect();
        if asks {
            wanted.push((None, self.all.passes));
        }
        let pointers: Vec<_> = (wanted.into_iter())
            .map(|(of, from)| (of, self.add(Expression::GlobalVariable(from))))
            .collect();
        let mut loads = Vec::new();
        for (of, pointer) in pointers {
            let load = self.add(Expression::Load { pointer });
            match of {
                Some(variable) => _ = self.at.insert(variable, load),
                None => self.passes = Some(load),
            }
            loads.push(load);
        }
        let bounds = loads.first().zip(loads.last());
        bounds
            .map(|(first, last)| Statement::Emit(Range::new_from_bounds(*first, *last)))
            .into_iter()
            .collect()
    }

    /// Rewrites everything, after the entry point's preamble.
    fn run(mut self, function: &mut Function, mut first: Statements) -> Result<()> {
        if first.is_empty() {
            first = self.load_parts();
        }
        let old: Vec<_> = self.old.iter().map(|(handle, _)| handle).collect();
        for handle in old {
            self.expression(handle)?;
        }
        let mut body = Block::new();
        first
            .into_iter()
            .for_each(|statement| body.push(statement, Span::UNDEFINED));
        self.block(std::mem::take(&mut function.body), &mut body)?;
        function.body = body;
        for (_, variable) in function.local_variables.iter_mut() {
            variable.init = variable.init.map(|init| self.new_of(init));
        }
        let names = std::mem::take(&mut function.named_expressions);
        function.named_expressions = names.into_iter().map(|(old, name)| (self.new_of(old), name)).collect();
        function.expressions = self.new;
        Ok(())
    }

    /// The replacement of an old expression.
    fn new_of(&self, old: Handle<Expression>) -> Handle<Expression> {
        self.places[old.index()].1
    }

    fn expression(&mut self, old: Handle<Expression>) -> Result<()> {
        let mut expression = self.old[old].clone();
        let before = self.new.len();
        match expression {
            Expression::Access { base, index } if self.part(base).is_some() => {
                let by = self.new_of(index);
                let kind = self.info[index].ty.inner_with(self.types).scalar_kind();
                if kind != Some(ScalarKind::Uint) {
                    return Err("a buffer of a pass is looked into by a signed number".to_owned());
                }
                expression = self.access(base, by);
            }
            Expression::AccessIndex { base, index } => {
                if let Some((_, part)) = self.part(base) {
                    expression = if part.is_list {
                        let by = self.literals[&index];
                        self.access(base, by)
                    } else {
                        let base = self.whole(base);
                        Expression::AccessIndex { base, index }
                    };
                } else {
                    let base = self.new_of(base);
                    expression = Expression::AccessIndex { base, index };
                }
            }
            Expression::Load { pointer } if self.part(pointer).is_some() => {
                let pointer = self.whole(pointer);
                expression = Expression::Load { pointer };
            }
            Expression::ArrayLength(list) if self.part(list).is_some() => {
                let left = self.add(Expression::ArrayLength(self.new_of(list)));
                let right = self.passes.ok_or("the number of passes is missing")?;
                let op = BinaryOperator::Divide;
                expression = Expression::Binary { op, left, right };
            }
            _ => self.of_new(&mut expression)?,
        }
        let place = self.add(expression);
        let first = self
            .new
            .range_from(before)
            .first_and_last()
            .map_or(place, |(first, _)| first);
        self.places.push((first, place));
        Ok(())
    }

    /// An element of a pass's part of a buffer.
    fn access(&mut self, buffer: Handle<Expression>, by: Handle<Expression>) -> Expression {
        let Some((variable, part)) = self.part(buffer) else {
            let base = self.new_of(buffer);
            return Expression::Access { base, index: by };
        };
        if !part.is_list {
            let base = self.whole(buffer);
            return Expression::Access { base, index: by };
        }
        let sum = Expression::Binary {
            op: BinaryOperator::Add,
            left: self.at[&variable],
            right: by,
        };
        let index = self.add(sum);
        let base = self.new_of(buffer);
        Expression::Access { base, index }
    }

    /// A pass's whole value in a buffer that was no list.
    fn whole(&mut self, buffer: Handle<Expression>) -> Handle<Expression> {
        let base = self.new_of(buffer);
        match self.part(buffer) {
            Some((variable, _)) => {
                let index = self.at[&variable];
                self.add(Expression::Access { base, index })
            }
            None => base,
        }
    }

    /// Replaces an expression's operands.
    fn of_new(&self, expression: &mut Expression) -> Result<()> {
        let mut uses: Vec<&mut Handle<Expression>> = Vec::new();
        match expression {
            Expression::Literal(_)
            | Expression::Constant(_)
            | Expression::ZeroValue(_)
            | Expression::FunctionArgument(_)
            | Expression::GlobalVariable(_)
            | Expression::LocalVariable(_)
            | Expression::CallResult(_)
            | Expression::AtomicResult { .. }
            | Expression::WorkGroupUniformLoadResult { .. } => {}
            Expression::Compose { components, .. } => uses.extend(components),
            Expression::Access { base, index } => uses.extend([base, index]),
            Expression::AccessIndex { base: one, .. }
            | Expression::Splat { value: one, .. }
            | Expression::Swizzle { vector: one, .. }
            | Expression::Load { pointer: one }
            | Expression::Unary { expr: one, .. }
            | Expression::Relational { argument: one, .. }
            | Expression::As { expr: one, .. }
            | Expression::ArrayLength(one) => uses.push(one),
            Expression::Binary { left, right, .. } => uses.extend([left, right]),
            Expression::Select {
                condition,
                accept,
                reject,
            } => uses.extend([condition, accept, reject]),
            Expression::Math {
                arg, arg1, arg2, arg3, ..
            } => {
                uses.push(arg);
                uses.extend([arg1, arg2, arg3].into_iter().flatten());
            }
            other => return Err(format!("{other:?} is not for kernels")),
        }
        uses.into_iter().try_for_each(|used| self.move_on(used))
    }

    fn move_on(&self, used: &mut Handle<Expression>) -> Result<()> {
        if self.part(*used).is_some() {
            return Err("a buffer of a pass is used as a whole".to_owned());
        }
        *used = self.new_of(*used);
        Ok(())
    }

    fn block(&mut self, old: Block, new: &mut Block) -> Result<()> {
        for (statement, span) in old.span_into_iter() {
            let statement = self.statement(statement, new)?;
            new.push(statement, span);
        }
        Ok(())
    }

    fn inner_block(&mut self, block: &mut Block) -> Result<()> {
        let mut new = Block::new();
        self.block(std::mem::take(block), &mut new)?;
        *block = new;
        Ok(())
    }

    /// The new form of a statement; expressions that it needs first go to the block.
    fn statement(&mut self, mut statement: Statement, before: &mut Block) -> Result<Statement> {
        match &mut statement {
            Statement::Emit(range) => {
                if let Some((first, last)) = range.first_and_last() {
                    let (first, last) = (self.places[first.index()].0, self.new_of(last));
                    *range = Range::new_from_bounds(first, last);
                }
            }
            Statement::Break
            | Statement::Continue
            | Statement::Kill
            | Statement::ControlBarrier(_)
            | Statement::MemoryBarrier(_) => {}
            Statement::Return { value } => value.iter_mut().try_for_each(|value| self.move_on(value))?,
            Statement::Block(block) => self.inner_block(block)?,
            Statement::If {
                condition,
                accept,
                reject,
            } => {
                self.move_on(condition)?;
                self.inner_block(accept)?;
                self.inner_block(reject)?;
            }
            Statement::Switch { selector, cases } => {
                self.move_on(selector)?;
                cases.iter_mut().try_for_each(|case| self.inner_block(&mut case.body))?;
            }
            Statement::Loop {
                body,
                continuing,
                break_if,
            } => {
                self.inner_block(body)?;
                self.inner_block(continuing)?;
                break_if.iter_mut().try_for_each(|break_if| self.move_on(break_if))?;
            }
            Statement::Store { pointer, value } => {
                *pointer = self.pointer(*pointer, before);
                self.move_on(value)?;
            }
            Statement::Atomic {
                pointer,
                fun,
                value,
                result,
            } => {
                *pointer = self.pointer(*pointer, before);
                if let naga::AtomicFunction::Exchange { compare } = fun {
                    compare.iter_mut().try_for_each(|compare| self.move_on(compare))?;
                }
                self.move_on(value)?;
                result.iter_mut().try_for_each(|result| self.move_on(result))?;
            }
            Statement::WorkGroupUniformLoad { pointer, result } => {
                *pointer = self.pointer(*pointer, before);
                self.move_on(result)?;
            }
            Statement::Call { arguments, result, .. } => {
                let all = arguments.iter_mut().chain(result);
                all.into_iter().try_for_each(|handle| self.move_on(handle))?;
            }
            other => return Err(format!("{other:?} is not for kernels")),
        }
        Ok(statement)
    }

    /// The pointer that is written through, possibly to a whole buffer that was no list.
    fn pointer(&mut self, old: Handle<Expression>, before: &mut Block) -> Handle<Expression> {
        let pointer = self.whole(old);
        if self.part(old).is_some() {
            let access = Statement::Emit(Range::new_from_bounds(pointer, pointer));
            before.push(access, Span::UNDEFINED);
        }
        pointer
    }
}
