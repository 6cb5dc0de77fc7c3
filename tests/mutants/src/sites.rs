//! Places in a file at which a switch can stand: every expression, arm, field and body that a mutant of the list may name.

use std::collections::{BTreeMap, HashSet};
use std::ops::Range;

use proc_macro2::Span;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

/// Bytes of the file.
pub type Bytes = Range<usize>;

/// The kind of syntax at a place.
#[derive(Clone, Debug)]
pub enum Shape {
    /// `left operator right`.
    Binary { left: Bytes, right: Bytes, operator: String },
    /// `operator operand`.
    Unary { operand: Bytes, operator: String },
    /// An arm of a match; its guard, if it has one.
    Arm { guard: Option<Bytes> },
    /// `member: value, ..base`.
    Field { member: String, value: Bytes, base: Bytes },
    /// The inside of a function's body.
    Body,
}

/// A place for a switch, and the text that the switch replaces.
#[derive(Clone, Debug)]
pub struct Found {
    /// The text that is replaced; empty where text is only added.
    pub range: Bytes,
    /// The kind of syntax there.
    pub shape: Shape,
    /// Why no switch can stand here.
    pub barred: Option<&'static str>,
}

/// The places of a file, by what names them in the list.
#[derive(Default)]
pub struct Places {
    /// Operators by their first byte.
    pub operators: BTreeMap<usize, Found>,
    /// Arms by their first byte.
    pub arms: BTreeMap<usize, Found>,
    /// Arms with a guard by the guard's first byte.
    pub guards: BTreeMap<usize, Found>,
    /// Fields by their first byte.
    pub fields: BTreeMap<usize, Found>,
    /// Bodies of functions with the bytes between their braces.
    pub bodies: Vec<(Bytes, Found)>,
    constant: usize,
    chains: HashSet<usize>,
}

impl Places {
    /// Finds the places of a file.
    pub fn of(file: &syn::File) -> Self {
        let mut places = Self::default();
        places.visit_file(file);
        places
    }

    /// The innermost body around a byte.
    pub fn body(&self, at: usize) -> Option<&Found> {
        let around = self.bodies.iter().filter(|(inside, _)| inside.start <= at && at <= inside.end);
        around.min_by_key(|(inside, _)| inside.len()).map(|(_, found)| found)
    }

    fn barred(&self) -> Option<&'static str> {
        (self.constant > 0).then_some("constant context")
    }

    fn in_constant(&mut self, visit: impl FnOnce(&mut Self)) {
        self.constant += 1;
        visit(self);
        self.constant -= 1;
    }

    fn function(&mut self, signature: &syn::Signature, block: &syn::Block, visit: impl FnOnce(&mut Self)) {
        let constant = signature.constness.is_some();
        self.constant += usize::from(constant);
        let braces = block.brace_token.span;
        let inside = braces.open().byte_range().end..braces.close().byte_range().start;
        // The value would have to be of the one type that the body returns.
        let hidden = matches!(&signature.output, syn::ReturnType::Type(_, kind) if names_impl(kind));
        let barred = self.barred().or(hidden.then_some("returns a type without a name"));
        let found = Found { range: inside.start..inside.start, shape: Shape::Body, barred };
        self.bodies.push((inside, found));
        visit(self);
        self.constant -= usize::from(constant);
    }
}

fn names_impl(kind: &syn::Type) -> bool {
    struct Search(bool);
    impl<'ast> Visit<'ast> for Search {
        fn visit_type_impl_trait(&mut self, _: &'ast syn::TypeImplTrait) {
            self.0 = true;
        }
    }
    let mut search = Search(false);
    search.visit_type(kind);
    search.0
}

fn bytes(span: Span) -> Bytes {
    span.byte_range()
}

/// The places of the `&&` of a chain in which a `let` stands; nothing where none does.
fn let_chain(expression: &syn::Expr, places: &mut Vec<usize>) -> bool {
    match expression {
        syn::Expr::Let(_) => true,
        syn::Expr::Binary(binary) => let_in_operands(binary, places),
        _ => false,
    }
}

fn let_in_operands(binary: &syn::ExprBinary, places: &mut Vec<usize>) -> bool {
    if !matches!(binary.op, syn::BinOp::And(_)) {
        return false;
    }
    places.push(bytes(binary.op.span()).start);
    let left = let_chain(&binary.left, places);
    let_chain(&binary.right, places) || left
}

impl<'ast> Visit<'ast> for Places {
    fn visit_item_const(&mut self, item: &'ast syn::ItemConst) {
        self.in_constant(|places| visit::visit_item_const(places, item));
    }

    fn visit_item_static(&mut self, item: &'ast syn::ItemStatic) {
        self.in_constant(|places| visit::visit_item_static(places, item));
    }

    fn visit_impl_item_const(&mut self, item: &'ast syn::ImplItemConst) {
        self.in_constant(|places| visit::visit_impl_item_const(places, item));
    }

    fn visit_trait_item_const(&mut self, item: &'ast syn::TraitItemConst) {
        self.in_constant(|places| visit::visit_trait_item_const(places, item));
    }

    fn visit_expr_const(&mut self, item: &'ast syn::ExprConst) {
        self.in_constant(|places| visit::visit_expr_const(places, item));
    }

    fn visit_variant(&mut self, item: &'ast syn::Variant) {
        self.in_constant(|places| visit::visit_variant(places, item));
    }

    fn visit_type(&mut self, item: &'ast syn::Type) {
        self.in_constant(|places| visit::visit_type(places, item));
    }

    fn visit_pat(&mut self, item: &'ast syn::Pat) {
        self.in_constant(|places| visit::visit_pat(places, item));
    }

    fn visit_expr_repeat(&mut self, item: &'ast syn::ExprRepeat) {
        self.visit_expr(&item.expr);
        self.in_constant(|places| places.visit_expr(&item.len));
    }

    fn visit_generic_argument(&mut self, item: &'ast syn::GenericArgument) {
        self.in_constant(|places| visit::visit_generic_argument(places, item));
    }

    fn visit_item_fn(&mut self, item: &'ast syn::ItemFn) {
        self.function(&item.sig, &item.block, |places| visit::visit_item_fn(places, item));
    }

    fn visit_impl_item_fn(&mut self, item: &'ast syn::ImplItemFn) {
        self.function(&item.sig, &item.block, |places| visit::visit_impl_item_fn(places, item));
    }

    fn visit_trait_item_fn(&mut self, item: &'ast syn::TraitItemFn) {
        match &item.default {
            Some(block) => self.function(&item.sig, block, |places| visit::visit_trait_item_fn(places, item)),
            None => visit::visit_trait_item_fn(self, item),
        }
    }

    fn visit_expr_binary(&mut self, item: &'ast syn::ExprBinary) {
        let mut chain = Vec::new();
        if let_in_operands(item, &mut chain) {
            self.chains.extend(chain);
        }
        let operator = bytes(item.op.span());
        let barred = self.barred().or(self.chains.contains(&operator.start).then_some("chain with let"));
        let shape = Shape::Binary {
            left: bytes(item.left.span()),
            right: bytes(item.right.span()),
            operator: item.op.span().source_text().unwrap_or_default(),
        };
        self.operators.insert(operator.start, Found { range: bytes(item.span()), shape, barred });
        visit::visit_expr_binary(self, item);
    }

    fn visit_expr_unary(&mut self, item: &'ast syn::ExprUnary) {
        let operator = item.op.span();
        let shape = Shape::Unary {
            operand: bytes(item.expr.span()),
            operator: operator.source_text().unwrap_or_default(),
        };
        let found = Found { range: bytes(item.span()), shape, barred: self.barred() };
        self.operators.insert(bytes(operator).start, found);
        visit::visit_expr_unary(self, item);
    }

    fn visit_arm(&mut self, arm: &'ast syn::Arm) {
        let guard = arm.guard.as_ref().map(|(_, guard)| bytes(guard.span()));
        let chain = arm.guard.as_ref().is_some_and(|(_, guard)| let_chain(guard, &mut Vec::new()));
        let pattern = bytes(arm.pat.span());
        let end = guard.as_ref().map_or(pattern.end, |guard| guard.end);
        let found = Found {
            range: pattern.end..end,
            shape: Shape::Arm { guard: guard.clone() },
            barred: self.barred().or(chain.then_some("chain with let")),
        };
        self.arms.insert(bytes(arm.span()).start, found.clone());
        if let Some(guard) = guard {
            self.guards.insert(guard.start, found);
        }
        visit::visit_arm(self, arm);
    }

    fn visit_expr_struct(&mut self, item: &'ast syn::ExprStruct) {
        if let Some(base) = &item.rest {
            for field in &item.fields {
                let syn::Member::Named(member) = &field.member else { continue };
                let shape = Shape::Field {
                    member: member.to_string(),
                    value: bytes(field.expr.span()),
                    base: bytes(base.span()),
                };
                let range = bytes(field.span());
                self.fields.insert(range.start, Found { range, shape, barred: self.barred() });
            }
        }
        visit::visit_expr_struct(self, item);
    }
}
