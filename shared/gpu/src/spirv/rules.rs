//! What a kernel may do. Operations that are not known to have the same bits on every device are forbidden, as found in
//! naga's form of the text.

use crate::error::{Error, Result};
use naga::common::wgsl::TryToWgsl as _;
use naga::proc::TypeResolution;
use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{
    BinaryOperator, Block, Expression, Function, Handle, MathFunction, Module, ScalarKind, Statement, Type, TypeInner,
};

/// The only function that may divide floats with `/`: the self-test finds out whether a device does that exactly, and
/// `quotient` uses it accordingly.
const DIVIDES: &str = "native_quotient";
/// The same for `sqrt`.
const TAKES_ROOTS: &str = "native_root";

/// Functions of floats that are exact by the specification, and so on every device.
const EXACT: [MathFunction; 5] = [
    MathFunction::Abs,
    MathFunction::Ceil,
    MathFunction::Floor,
    MathFunction::Round,
    MathFunction::Trunc,
];

/// Checks all functions of a kernel, in order.
///
/// # Errors
/// [`Error::Forbidden`] for the first forbidden operation, [`Error::Kernel`] if there are overrides, which would be
/// filled in later.
pub fn check(kernel: &str, module: &Module, info: &ModuleInfo) -> Result<()> {
    let forbidden = |function: &str, operation: String| Error::Forbidden {
        kernel: kernel.to_owned(),
        function: function.to_owned(),
        operation,
    };
    if let Some((_, first)) = module.overrides.iter().next() {
        return Err(Error::Kernel {
            kernel: kernel.to_owned(),
            reason: format!("\"{}\" is an override", first.name.as_deref().unwrap_or_default()),
        });
    }
    let functions = module
        .functions
        .iter()
        .map(|(handle, function)| (function.name.as_deref().unwrap_or_default(), function, &info[handle]));
    let entries = module
        .entry_points
        .iter()
        .enumerate()
        .map(|(i, entry)| (entry.name.as_str(), &entry.function, info.get_entry_point(i)));
    for (name, function, info) in functions.chain(entries) {
        let here = Here { module, name, info };
        for (handle, expression) in function.expressions.iter() {
            if let Some(operation) = here.forbidden(handle, expression) {
                return Err(forbidden(name, operation));
            }
        }
        if here.stores_by_number(function, &function.body) {
            return Err(forbidden(
                name,
                "a store to the component of a vector that a number says".to_owned(),
            ));
        }
    }
    Ok(())
}

struct Here<'a> {
    module: &'a Module,
    name: &'a str,
    info: &'a FunctionInfo,
}

impl Here<'_> {
    /// The forbidden operation in an expression, if any.
    fn forbidden(&self, handle: Handle<Expression>, expression: &Expression) -> Option<String> {
        if let Some(name) = self.forbidden_type(handle) {
            return Some(name.to_owned());
        }
        match *expression {
            Expression::Binary { op, left, .. } if self.is_float(left) => match op {
                BinaryOperator::Divide if self.name != DIVIDES => Some("/ of floats".to_owned()),
                // naga compiles it to a comparison that is false for NaN.
                BinaryOperator::NotEqual => Some("!= of floats".to_owned()),
                BinaryOperator::Modulo => Some("% of floats".to_owned()),
                _ => None,
            },
            Expression::Math { fun, arg, .. } if self.is_float(arg) || self.is_float(handle) => {
                let allowed = EXACT.contains(&fun) || (fun == MathFunction::Sqrt && self.name == TAKES_ROOTS);
                (!allowed).then(|| format!("{} of floats", fun.to_wgsl_for_diagnostics()))
            }
            Expression::Derivative { .. } => Some("a derivative".to_owned()),
            // The previous value depends on which thread came first.
            Expression::AtomicResult { .. } if self.info[handle].ref_count > 0 => {
                Some("the result of an atomic operation".to_owned())
            }
            // The size of a subgroup depends on the device.
            Expression::SubgroupBallotResult | Expression::SubgroupOperationResult { .. } => {
                Some("a subgroup operation".to_owned())
            }
            _ => None,
        }
    }

    /// Whether a vector component is written by a dynamic index: some drivers lose it.
    fn stores_by_number(&self, function: &Function, block: &Block) -> bool {
        let is_component = |pointer: Handle<Expression>| match function.expressions[pointer] {
            Expression::Access { .. } => {
                let inner = self.info[pointer].ty.inner_with(&self.module.types);
                matches!(inner, TypeInner::ValuePointer { size: None, .. })
            }
            _ => false,
        };
        block.iter().any(|statement| match statement {
            Statement::Store { pointer, .. } => is_component(*pointer),
            Statement::Block(block) => self.stores_by_number(function, block),
            Statement::If { accept, reject, .. } => [accept, reject]
                .iter()
                .any(|block| self.stores_by_number(function, block)),
            Statement::Switch { cases, .. } => cases.iter().any(|case| self.stores_by_number(function, &case.body)),
            Statement::Loop { body, continuing, .. } => [body, continuing]
                .iter()
                .any(|block| self.stores_by_number(function, block)),
            _ => false,
        })
    }

    fn is_float(&self, handle: Handle<Expression>) -> bool {
        let inner = self.info[handle].ty.inner_with(&self.module.types);
        inner.scalar_kind() == Some(ScalarKind::Float)
    }

    fn forbidden_type(&self, handle: Handle<Expression>) -> Option<&'static str> {
        match self.info[handle].ty {
            TypeResolution::Handle(ty) => self.of_type(ty),
            TypeResolution::Value(ref inner) => self.of_inner(inner),
        }
    }

    fn of_type(&self, ty: Handle<Type>) -> Option<&'static str> {
        self.of_inner(&self.module.types[ty].inner)
    }

    fn of_inner(&self, inner: &TypeInner) -> Option<&'static str> {
        match *inner {
            TypeInner::Scalar(scalar) | TypeInner::Vector { scalar, .. } | TypeInner::ValuePointer { scalar, .. } => {
                match (scalar.kind, scalar.width) {
                    (ScalarKind::Float, 2) => Some("f16"),
                    (ScalarKind::Float, 8) => Some("f64"),
                    // Some devices lack them; `wide.wgsl` builds them from two 32-bit ones.
                    (ScalarKind::Sint | ScalarKind::Uint, 8) => Some("a 64-bit integer"),
                    _ => None,
                }
            }
            TypeInner::Matrix { .. } => Some("a matrix"),
            TypeInner::CooperativeMatrix { .. } => Some("a cooperative matrix"),
            TypeInner::Atomic(scalar) if scalar.kind == ScalarKind::Float => Some("an atomic float"),
            TypeInner::Atomic(scalar) if scalar.width == 8 => Some("a 64-bit atomic"),
            TypeInner::Image { .. } => Some("an image"),
            TypeInner::Sampler { .. } => Some("a sampler of images"),
            TypeInner::AccelerationStructure { .. } | TypeInner::RayQuery { .. } => Some("a ray query"),
            TypeInner::Pointer { base, .. } | TypeInner::Array { base, .. } | TypeInner::BindingArray { base, .. } => {
                self.of_type(base)
            }
            TypeInner::Struct { ref members, .. } => members.iter().find_map(|member| self.of_type(member.ty)),
            TypeInner::Atomic(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::error::Error;
    use crate::spirv::check;

    /// The operation for which a function `f` with this body is rejected.
    fn refused(head: &str, body: &str) -> Option<String> {
        let source = format!(
            "{head}
            @group(0) @binding(0) var<storage, read_write> floats: array<vec4f>;
            fn f(a: f32, b: f32, u: u32, v: vec3f) {{ {body} }}
            @compute @workgroup_size(64) fn main() {{ f(floats[0].x, 1.0, 2u, floats[1].xyz); }}"
        );
        match check("test", &source) {
            Ok(_) => None,
            Err(Error::Forbidden {
                kernel,
                function,
                operation,
            }) => {
                assert_eq!((kernel.as_str(), function.as_str()), ("test", "f"), "{body}");
                Some(operation)
            }
            Err(error) => panic!("{body}: {error}"),
        }
    }

    #[test]
    fn functions_that_differ_between_devices_are_refused() {
        let of_one = "cos cosh sin sinh tan tanh acos asin atan asinh acosh atanh radians degrees fract exp exp2 log \
                      log2 sqrt inverseSqrt sign saturate quantizeToF16";
        for name in of_one.split_whitespace() {
            assert_eq!(
                refused("", &format!("_ = {name}(a);")),
                Some(format!("{name} of floats"))
            );
            assert_eq!(
                refused("", &format!("_ = {name}(v);")),
                Some(format!("{name} of floats"))
            );
        }
        for name in "atan2 pow step min max".split_whitespace() {
            assert_eq!(
                refused("", &format!("_ = {name}(a, b);")),
                Some(format!("{name} of floats"))
            );
        }
        for name in "dot distance cross reflect".split_whitespace() {
            assert_eq!(
                refused("", &format!("_ = {name}(v, v);")),
                Some(format!("{name} of floats"))
            );
        }
        for (name, call) in [
            ("length", "length(v)"),
            ("normalize", "normalize(v)"),
            ("refract", "refract(v, v, a)"),
            ("faceForward", "faceForward(v, v, v)"),
            ("fma", "fma(a, b, a)"),
            ("mix", "mix(a, b, a)"),
            ("mix", "mix(v, v, a)"),
            ("smoothstep", "smoothstep(a, b, a)"),
            ("clamp", "clamp(a, 0.0, b)"),
            ("modf", "modf(a).whole"),
            ("frexp", "frexp(a).exp"),
            ("ldexp", "ldexp(a, 2)"),
            ("pack2x16float", "pack2x16float(v.xy)"),
            ("pack4x8unorm", "pack4x8unorm(v.xyzz)"),
            ("unpack2x16float", "unpack2x16float(u)"),
            ("unpack4x8snorm", "unpack4x8snorm(u)"),
        ] {
            assert_eq!(
                refused("", &format!("_ = {call};")),
                Some(format!("{name} of floats")),
                "{call}"
            );
        }
    }

    #[test]
    fn divisions_and_roots_are_for_one_function_each() {
        for body in ["_ = a / b;", "_ = v / b;", "_ = v / v;", "var x = a; x /= b;"] {
            assert_eq!(refused("", body).as_deref(), Some("/ of floats"));
        }
        assert_eq!(refused("", "_ = a % b;").as_deref(), Some("% of floats"));
        assert_eq!(refused("", "_ = a != b;").as_deref(), Some("!= of floats"));
        assert_eq!(refused("", "_ = !(a == b) && u != 3u;"), None);
        assert_eq!(refused("", "_ = u / 3u + u % 5u;"), None);
        let own = "fn native_quotient(a: f32, b: f32) -> f32 { return a / b; }
                   fn native_root(a: f32) -> f32 { return sqrt(a); }";
        assert_eq!(refused(own, "_ = native_quotient(a, native_root(b));"), None);
        let swapped = |body| match check("test", &format!("fn native_root(a: f32) -> f32 {{ return {body}; }}")) {
            Err(Error::Forbidden { operation, .. }) => Some(operation),
            _ => None,
        };
        assert_eq!(swapped("1.0 / a").as_deref(), Some("/ of floats"));
        assert_eq!(swapped("inverseSqrt(a)").as_deref(), Some("inverseSqrt of floats"));
        assert_eq!(swapped("sqrt(a)"), None);
    }

    #[test]
    fn types_that_not_all_devices_treat_alike_are_refused() {
        for (head, body, operation) in [
            ("enable f16;", "_ = f16(a);", "f16"),
            ("", "_ = f64(a);", "f64"),
            ("", "_ = u64(u) + 1lu;", "a 64-bit integer"),
            ("", "_ = mat3x3f(v, v, v) * v;", "a matrix"),
            ("", "var m: array<mat2x2f, 3>; _ = a; m[0] = m[1];", "a matrix"),
            (
                "@group(0) @binding(1) var<storage, read_write> sum: atomic<f32>;",
                "atomicAdd(&sum, a);",
                "an atomic float",
            ),
            (
                "struct S { n: u32, x: atomic<f32> } @group(0) @binding(1) var<storage, read_write> s: S;",
                "atomicStore(&s.x, a);",
                "an atomic float",
            ),
            (
                "@group(0) @binding(1) var image: texture_2d<f32>;",
                "_ = textureLoad(image, vec2u(u, u), 0);",
                "an image",
            ),
            ("", "_ = subgroupAdd(a);", "a subgroup operation"),
            ("", "_ = subgroupBallot(a > b);", "a subgroup operation"),
        ] {
            assert_eq!(refused(head, body).as_deref(), Some(operation), "{body}");
        }
    }

    #[test]
    fn derivatives_are_refused() {
        // Where kernels call them, naga itself reports it.
        let error = check("test", "fn f(a: f32) -> f32 { return dpdx(a); }").err().unwrap();
        let expected = "kernel \"test\": function \"f\" uses a derivative, whose result differs between devices";
        assert_eq!(error.to_string(), expected);
    }

    #[test]
    fn what_atomic_operations_return_is_not_used() {
        let head = "var<workgroup> n: atomic<u32>; @group(0) @binding(1) var<storage, read_write> all: array<u32>;";
        let by_chance = Some("the result of an atomic operation".to_owned());
        assert_eq!(refused(head, "all[atomicAdd(&n, 1u)] = u;"), by_chance);
        assert_eq!(refused(head, "let at = atomicMax(&n, u); all[at] = u;"), by_chance);
        assert_eq!(
            refused(
                head,
                "if (atomicCompareExchangeWeak(&n, 1u, u).exchanged) { all[0] = u; }"
            ),
            by_chance
        );
        assert_eq!(refused(head, "atomicAdd(&n, u); all[0] = atomicLoad(&n);"), None);
    }

    #[test]
    fn components_of_vectors_are_stored_by_name() {
        let by_number = Some("a store to the component of a vector that a number says".to_owned());
        for body in [
            "var w = v; w[u] = a;",
            "var w = v; if (a > b) { for (var i = 0u; i < 3u; i++) { w[i] = a; } }",
            "floats[0][u] = a;",
            "var w: array<vec3f, 2>; switch u { case 1u: { } default: { w[1][u] += a; } }",
        ] {
            assert_eq!(refused("", body), by_number, "{body}");
        }
        for body in [
            "var w = v; w.y = a; w[2] = v[u]; floats[u].x = w[u];",
            "var w: array<f32, 3>; w[u] = a;",
            "var w: array<vec3f, 2>; w[u] = v; w[u].x = a;",
        ] {
            assert_eq!(refused("", body), None, "{body}");
        }
    }

    #[test]
    fn what_is_exact_is_allowed() {
        for body in [
            "_ = a + b * a - -b;",
            "_ = v * a + v - v * v;",
            "_ = abs(a) + floor(a) + ceil(a) + trunc(a) + round(a);",
            "_ = select(a, b, a < b);",
            "_ = min(u, 3u) + max(u, 4u) + clamp(u, 1u, 2u) + countLeadingZeros(u) + reverseBits(u);",
            "_ = bitcast<u32>(a) + u32(a) + u32(i32(b)); _ = f32(u);",
        ] {
            assert_eq!(refused("", body), None, "{body}");
        }
    }

    #[test]
    fn a_kernel_is_compiled_as_it_stands() {
        let error = check("test", "override n: u32 = 3; fn f() -> u32 { return n; }")
            .err()
            .unwrap();
        assert_eq!(
            error.to_string(),
            "kernel \"test\" does not compile: \"n\" is an override"
        );
    }
}
