//! From naga's expressions to [`Code`]; the statements are in [`super::statements`].

use naga::valid::FunctionInfo;
use naga::{AddressSpace, ArraySize, Expression, Function, Handle, Literal, Module, Scalar, Span, Type, TypeInner};

use super::code::{Code, Index, Loaded, Op, Step};
use super::value::{Kind, Pointer, Space, Value, Words};

/// Words of a value in memory: those of buffers as the language lays them out, and one for a truth value.
pub(super) fn words_of(module: &Module, ty: Handle<Type>) -> u32 {
    match module.types[ty].inner {
        TypeInner::Array { base, size, stride } => {
            let count = if let ArraySize::Constant(count) = size { count.get() } else { 0 };
            count * stride_of(module, base, stride)
        }
        TypeInner::Struct { span, .. } => span.div_ceil(4),
        TypeInner::Vector { size, .. } => size as u32,
        _ => 1,
    }
}

pub(super) fn stride_of(module: &Module, base: Handle<Type>, stride: u32) -> u32 {
    // Truth values are a byte in naga's layouts; no buffer has one.
    if stride < 4 { words_of(module, base) } else { stride / 4 }
}

pub(super) struct Lowering<'a> {
    pub module: &'a Module,
    pub function: &'a Function,
    pub info: &'a FunctionInfo,
    pub shared: &'a [Handle<naga::GlobalVariable>],
    pub steps: Vec<Step>,
    pub spans: Vec<Span>,
    /// Jumps out of the loop or switch, and to the loop's continuation, that wait for their target.
    pub breaks: Vec<Vec<usize>>,
    pub continues: Vec<Vec<usize>>,
}

impl<'a> Lowering<'a> {
    pub fn of(
        module: &'a Module,
        function: &'a Function,
        info: &'a FunctionInfo,
        shared: &'a [Handle<naga::GlobalVariable>],
    ) -> Code {
        let (steps, spans) = (Vec::new(), Vec::new());
        let mut own = Self { module, function, info, shared, steps, spans, breaks: Vec::new(), continues: Vec::new() };
        let (places, words) = own.variables();
        let ready = function.expressions.iter().map(|(_, expression)| own.ready(expression, &places)).collect();
        let ops = function.expressions.iter().map(|(handle, expression)| own.op(handle, expression)).collect();
        let mut arguments = Vec::new();
        for (handle, expression) in function.expressions.iter() {
            if let Expression::FunctionArgument(k) = *expression
                && let Some(naga::Binding::BuiltIn(what)) = function.arguments[k as usize].binding
            {
                arguments.push((handle.index(), what));
            }
        }
        own.block(&function.body);
        own.step(Step::End, Span::UNDEFINED);
        Code { ops, steps: own.steps, spans: own.spans, ready, arguments, own: words }
    }

    /// Place of each variable, and the first words of all.
    fn variables(&self) -> (Vec<u32>, Vec<u32>) {
        let (mut places, mut words) = (Vec::new(), Vec::new());
        for (_, variable) in self.function.local_variables.iter() {
            let place = words.len();
            places.push(place as u32);
            words.resize(place + words_of(self.module, variable.ty) as usize, 0);
            let first = variable.init.and_then(|init| known(self.module, &self.function.expressions, init));
            for (word, first) in words[place..].iter_mut().zip(first.iter().flat_map(|first| first.slice())) {
                *word = *first;
            }
        }
        (places, words)
    }

    fn ready(&self, expression: &Expression, places: &[u32]) -> Value {
        let pointer = |space, at| Value::Pointer(Pointer { space, at, outside: false });
        match *expression {
            Expression::LocalVariable(variable) => pointer(Space::Own, places[variable.index()]),
            Expression::GlobalVariable(variable) => {
                let global = &self.module.global_variables[variable];
                match (global.space, &global.binding) {
                    (AddressSpace::WorkGroup, _) => {
                        let number = self.shared.iter().position(|shared| *shared == variable);
                        pointer(Space::Shared(number.expect("every shared variable is listed") as u32), 0)
                    }
                    (_, Some(binding)) => pointer(Space::Buffer(binding.binding), 0),
                    _ => Value::Nothing,
                }
            }
            _ => known_value(self.module, &self.function.expressions, expression).map_or(Value::Nothing, Value::Words),
        }
    }

    fn inner(&self, handle: Handle<Expression>) -> &TypeInner {
        self.info[handle].ty.inner_with(&self.module.types)
    }

    /// The element one index behind `base`.
    fn access(&self, base: Handle<Expression>, index: Index) -> Op {
        let at = base.index();
        let word = |count| Op::Index { base: at, index, stride: 1, count: Some(count) };
        match *self.inner(base) {
            TypeInner::Pointer { base: ty, .. } => match (&self.module.types[ty].inner, index) {
                (TypeInner::Array { base, size, stride }, _) => {
                    let stride = stride_of(self.module, *base, *stride);
                    let count = if let ArraySize::Constant(count) = size { Some(count.get()) } else { None };
                    Op::Index { base: at, index, stride, count }
                }
                (TypeInner::Vector { size, .. }, _) => word(*size as u32),
                (TypeInner::Struct { members, .. }, Index::Known(k)) => {
                    let place = members[k as usize].offset / 4;
                    Op::Index { base: at, index: Index::Known(place), stride: 1, count: Some(u32::MAX) }
                }
                _ => Op::Unknown("an index"),
            },
            TypeInner::ValuePointer { size: Some(size), .. } => word(size as u32),
            TypeInner::Vector { .. } => Op::Element { base: at, index },
            _ => Op::Unknown("an index of a value"),
        }
    }

    pub fn loaded(&self, pointer: Handle<Expression>) -> Option<Loaded> {
        let of = |scalar: Scalar, len, atomic| Some(Loaded { kind: Kind::of(scalar.kind)?, len, atomic });
        match *self.inner(pointer) {
            TypeInner::Pointer { base, .. } => match self.module.types[base].inner {
                TypeInner::Scalar(scalar) => of(scalar, 1, false),
                TypeInner::Atomic(scalar) => of(scalar, 1, true),
                TypeInner::Vector { size, scalar } => of(scalar, size as u8, false),
                _ => None,
            },
            TypeInner::ValuePointer { size, scalar, .. } => of(scalar, size.map_or(1, |size| size as u8), false),
            _ => None,
        }
    }

    fn op(&self, handle: Handle<Expression>, expression: &Expression) -> Op {
        match *expression {
            Expression::Access { base, index } => self.access(base, Index::Of(index.index())),
            Expression::AccessIndex { base, index } => self.access(base, Index::Known(index)),
            Expression::Splat { size, value } => Op::Splat { len: size as u8, value: value.index() },
            Expression::Swizzle { size, vector, pattern } => {
                let pattern = pattern[..size as usize].iter().map(|component| *component as usize).collect();
                Op::Swizzle { vector: vector.index(), pattern }
            }
            Expression::Compose { ref components, .. } => match self.inner(handle) {
                TypeInner::Vector { .. } => Op::Compose(components.iter().map(|part| part.index()).collect()),
                // Stored part by part.
                _ => Op::Ready,
            },
            Expression::Load { pointer } => match self.loaded(pointer) {
                Some(of) => Op::Load { pointer: pointer.index(), of },
                None => Op::Unknown("a load of many words"),
            },
            Expression::Unary { op, expr } => Op::Unary(op, expr.index()),
            Expression::Binary { op, left, right } => Op::Binary(op, left.index(), right.index()),
            Expression::Select { condition, accept, reject } => {
                Op::Select(condition.index(), accept.index(), reject.index())
            }
            Expression::Relational { fun, argument } => match fun {
                naga::RelationalFunction::All => Op::Whether { all: true, of: argument.index() },
                naga::RelationalFunction::Any => Op::Whether { all: false, of: argument.index() },
                _ => Op::Unknown("a relation"),
            },
            Expression::Math { fun, arg, arg1, arg2, arg3 } => {
                let arguments = [Some(arg), arg1, arg2, arg3].into_iter().flatten();
                Op::Math(fun, arguments.map(|argument| argument.index()).collect())
            }
            Expression::As { expr, kind, convert } => match Kind::of(kind) {
                Some(to) if convert.is_none_or(|width| width <= 4) => {
                    Op::Cast { value: expr.index(), to, convert: convert.is_some() }
                }
                _ => Op::Unknown("a cast"),
            },
            Expression::ArrayLength(pointer) => Op::Len(pointer.index()),
            Expression::Literal(_)
            | Expression::Constant(_)
            | Expression::ZeroValue(_)
            | Expression::FunctionArgument(_)
            | Expression::GlobalVariable(_)
            | Expression::LocalVariable(_)
            | Expression::AtomicResult { .. }
            | Expression::WorkGroupUniformLoadResult { .. } => Op::Ready,
            _ => Op::Unknown("an expression"),
        }
    }
}

fn known(module: &Module, arena: &naga::Arena<Expression>, handle: Handle<Expression>) -> Option<Words> {
    known_value(module, arena, &arena[handle])
}

/// The value of a constant scalar or vector.
fn known_value(module: &Module, arena: &naga::Arena<Expression>, expression: &Expression) -> Option<Words> {
    match *expression {
        Expression::Literal(literal) => match literal {
            Literal::F32(value) => Some(Words::scalar(Kind::F32, value.to_bits())),
            Literal::U32(value) => Some(Words::scalar(Kind::U32, value)),
            Literal::I32(value) => Some(Words::scalar(Kind::I32, value as u32)),
            Literal::Bool(value) => Some(Words::scalar(Kind::Bool, u32::from(value))),
            _ => None,
        },
        Expression::Constant(constant) => known(module, &module.global_expressions, module.constants[constant].init),
        Expression::ZeroValue(ty) => match module.types[ty].inner {
            TypeInner::Scalar(scalar) => Some(Words::scalar(Kind::of(scalar.kind)?, 0)),
            TypeInner::Vector { size, scalar } => {
                Some(Words { kind: Kind::of(scalar.kind)?, len: size as u8, words: [0; 4] })
            }
            _ => None,
        },
        Expression::Compose { ty, ref components } => match module.types[ty].inner {
            TypeInner::Vector { scalar, .. } => {
                let parts: Option<Vec<Words>> = components.iter().map(|part| known(module, arena, *part)).collect();
                let words: Vec<u32> = parts?.iter().flat_map(|part| part.slice().to_vec()).collect();
                Some(Words::of(Kind::of(scalar.kind)?, &words))
            }
            _ => None,
        },
        Expression::Splat { size, value } => {
            let value = known(module, arena, value)?;
            Some(Words { len: size as u8, words: [value.words[0]; 4], ..value })
        }
        _ => None,
    }
}
