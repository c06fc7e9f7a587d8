//! From naga's statements to steps.

use naga::{Barrier, Block, Expression, Handle, Span, Statement, SwitchValue, TypeInner};

use super::code::{At, AtomicOp, Step};
use super::lower::{Lowering, stride_of, words_of};

impl Lowering<'_> {
    pub fn step(&mut self, step: Step, span: Span) -> usize {
        self.steps.push(step);
        self.spans.push(span);
        self.steps.len() - 1
    }

    /// Lets a jump lead to the next step.
    fn land(&mut self, jump: usize) {
        let here = self.steps.len();
        match &mut self.steps[jump] {
            Step::Jump(to) | Step::JumpIf { to, .. } => *to = here,
            _ => unreachable!("only jumps land"),
        }
    }

    pub fn block(&mut self, block: &Block) {
        for (statement, span) in block.span_iter() {
            self.statement(statement, *span);
        }
    }

    fn statement(&mut self, statement: &Statement, span: Span) {
        match *statement {
            Statement::Emit(ref range) => {
                let at: Vec<At> = range.clone().map(|handle| handle.index()).collect();
                if let (Some(first), Some(last)) = (at.first(), at.last()) {
                    self.step(Step::Compute(*first..last + 1), span);
                }
            }
            Statement::Block(ref block) => self.block(block),
            Statement::If { condition, ref accept, ref reject } => {
                let condition = condition.index();
                let over = self.step(Step::JumpIf { condition, expected: false, to: 0 }, span);
                self.block(accept);
                let end = self.step(Step::Jump(0), span);
                self.land(over);
                self.block(reject);
                self.land(end);
            }
            Statement::Switch { selector, ref cases } => self.switch(selector, cases, span),
            Statement::Loop { ref body, ref continuing, break_if } => {
                let begin = self.steps.len();
                self.breaks.push(Vec::new());
                self.continues.push(Vec::new());
                self.block(body);
                self.continues.pop().into_iter().flatten().for_each(|jump| self.land(jump));
                self.block(continuing);
                match break_if {
                    Some(condition) => {
                        self.step(Step::JumpIf { condition: condition.index(), expected: false, to: begin }, span)
                    }
                    None => self.step(Step::Jump(begin), span),
                };
                self.breaks.pop().into_iter().flatten().for_each(|jump| self.land(jump));
            }
            Statement::Break => {
                let jump = self.step(Step::Jump(0), span);
                self.breaks.last_mut().expect("a loop is open").push(jump);
            }
            Statement::Continue => {
                let jump = self.step(Step::Jump(0), span);
                self.continues.last_mut().expect("a loop is open").push(jump);
            }
            Statement::Return { .. } => {
                self.step(Step::End, span);
            }
            Statement::ControlBarrier(flags) => {
                self.step(Step::Barrier(flags), span);
            }
            Statement::Store { pointer, value } => self.store(pointer, value, span),
            Statement::WorkGroupUniformLoad { pointer, result } => {
                // The barrier behind the load is WGSL's alone, so it is left out: CUDA, Metal and SPIR-V have one
                // before it.
                self.step(Step::Barrier(Barrier::WORK_GROUP), span);
                let read = match self.loaded(pointer) {
                    Some(of) => Step::Read { pointer: pointer.index(), of, result: result.index() },
                    None => Step::Unknown("a uniform load of many words"),
                };
                self.step(read, span);
            }
            Statement::Atomic { pointer, ref fun, value, result } => {
                let fun = match *fun {
                    naga::AtomicFunction::Add => AtomicOp::Do(naga::BinaryOperator::Add),
                    naga::AtomicFunction::Subtract => AtomicOp::Do(naga::BinaryOperator::Subtract),
                    naga::AtomicFunction::And => AtomicOp::Do(naga::BinaryOperator::And),
                    naga::AtomicFunction::ExclusiveOr => AtomicOp::Do(naga::BinaryOperator::ExclusiveOr),
                    naga::AtomicFunction::InclusiveOr => AtomicOp::Do(naga::BinaryOperator::InclusiveOr),
                    naga::AtomicFunction::Min => AtomicOp::Min,
                    naga::AtomicFunction::Max => AtomicOp::Max,
                    naga::AtomicFunction::Exchange { compare: None } => AtomicOp::Exchange,
                    naga::AtomicFunction::Exchange { compare: Some(_) } => {
                        self.step(Step::Unknown("a comparison with an exchange"), span);
                        return;
                    }
                };
                let (pointer, value) = (pointer.index(), value.index());
                self.step(Step::Atomic { pointer, fun, value, result: result.map(|result| result.index()) }, span);
            }
            _ => {
                self.step(Step::Unknown("a statement"), span);
            }
        }
    }

    fn store(&mut self, pointer: Handle<Expression>, value: Handle<Expression>, span: Span) {
        let at = pointer.index();
        let step = match (self.loaded(pointer), &self.function.expressions[value]) {
            (Some(of), _) => Step::Store { pointer: at, value: value.index(), atomic: of.atomic },
            (None, Expression::ZeroValue(ty)) => Step::Clear { pointer: at, words: words_of(self.module, *ty) },
            (None, Expression::Compose { ty, components }) => match self.module.types[*ty].inner {
                TypeInner::Array { base, stride, .. } => Step::StoreEach {
                    pointer: at,
                    values: components.iter().map(|part| part.index()).collect(),
                    stride: stride_of(self.module, base, stride),
                },
                _ => Step::Unknown("a store of a structure"),
            },
            _ => Step::Unknown("a store of many words"),
        };
        self.step(step, span);
    }

    fn switch(&mut self, selector: Handle<Expression>, cases: &[naga::SwitchCase], span: Span) {
        let choose = self.step(Step::Unknown("a switch"), span);
        let (mut targets, mut default) = (Vec::new(), None);
        self.breaks.push(Vec::new());
        for case in cases {
            let here = self.steps.len();
            match case.value {
                SwitchValue::I32(value) => targets.push((value as u32, here)),
                SwitchValue::U32(value) => targets.push((value, here)),
                SwitchValue::Default => default = Some(here),
            }
            self.block(&case.body);
            if !case.fall_through {
                let jump = self.step(Step::Jump(0), span);
                self.breaks.last_mut().expect("this switch is open").push(jump);
            }
        }
        self.breaks.pop().into_iter().flatten().for_each(|jump| self.land(jump));
        let default = default.unwrap_or(self.steps.len());
        self.steps[choose] = Step::Choose { selector: selector.index(), cases: targets, default };
    }
}
