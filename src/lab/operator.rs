//! One part and channel of a laboratory's light transport, as a linear operator for the Krylov methods.

use std::sync::{Arc, Mutex};

use super::SharedObserver;
use super::lock;
use super::transport::{LightTransport, Shape};
use crate::error::{Error, Result};
use crate::observer::{Observer, PhotoTaken};
use crate::operator::{Adjoint, Direction, Operator, Product, Selection, Symmetry, Vectors};
use crate::report::contact_sheet::ContactSheet;
use crate::transport::Part;

/// `y = P x` for one part `P` and one channel of the light transport matrix. Each product is one photo, either simulated or taken by a rig.
///
/// The operator shares ownership of the light transport, so it can outlive the laboratory and move to another thread. Only one operator of
/// a laboratory works at a time. In a run with a folder, each photo is stored in the journal first, so that none is taken twice.
pub struct LabOperator {
    transport: Arc<Mutex<LightTransport>>,
    shape: Shape,
    part: Part,
    channel: usize,
    observer: SharedObserver,
    /// The record of photos for the report. It is `None` if the products are not photos of the run.
    sheet: Option<Arc<Mutex<ContactSheet>>>,
    photos: usize,
    /// Whether products only confirm an answer. Such products need no photo of a rig, do not count as photos, and are never estimated by a
    /// model.
    is_confirming: bool,
    /// The standard errors of the products of the last call. The list is empty if the source does not know them.
    errors: Vec<f64>,
}

impl LabOperator {
    pub(super) fn new(
        transport: &Arc<Mutex<LightTransport>>,
        part: Part,
        channel: usize,
        observer: &SharedObserver,
        sheet: Option<&Arc<Mutex<ContactSheet>>>,
    ) -> Self {
        let (transport, sheet) = (Arc::clone(transport), sheet.map(Arc::clone));
        let shape = lock(&transport).shape();
        Self {
            transport,
            shape,
            part,
            channel,
            observer: observer.clone(),
            sheet,
            photos: 0,
            is_confirming: false,
            errors: Vec::new(),
        }
    }

    /// The part of the light.
    pub fn part(&self) -> Part {
        self.part
    }

    /// The channel, an index below the laboratory's number of channels.
    pub fn channel(&self) -> usize {
        self.channel
    }

    /// The number of products with this operator and its transpose so far.
    pub fn photos(&self) -> usize {
        self.photos
    }

    /// Whether a product takes little computing time and needs no photo of a rig.
    pub(crate) fn is_free(&self) -> bool {
        lock(&self.transport).is_free()
    }

    fn products(&mut self, direction: Direction, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let of = (self.part, self.channel);
        self.errors = lock(&self.transport).products((of, self.is_confirming), direction, xs, ys)?;
        if self.is_confirming {
            return Ok(());
        }
        self.photos += xs.len();
        let mut goes_on = true;
        for (pattern, photo) in xs.iter().zip(ys) {
            goes_on &= self.show(pattern, photo, direction == Direction::Adjoint)?;
        }
        if goes_on { Ok(()) } else { Err(Error::Interrupted) }
    }

    /// Shows a photo to the report and the observer. Returns whether the observer goes on.
    fn show(&self, pattern: &[f64], photo: &[f64], is_dual: bool) -> Result<bool> {
        let Some(sheet) = &self.sheet else { return Ok(true) };
        lock(sheet).push(self.channel, pattern, photo, is_dual)?;
        let taken = PhotoTaken { channel: self.channel, pattern, photo, is_dual };
        Ok(self.observer.0.photo(&taken).is_continue())
    }
}

impl Operator for LabOperator {
    fn rows(&self) -> usize {
        self.shape.photos.pixels()
    }

    fn cols(&self) -> usize {
        self.shape.patterns.pixels()
    }

    fn symmetry(&self) -> Symmetry {
        self.shape.symmetry
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.products(Direction::Forward, xs, ys)
    }

    fn block_size(&self) -> usize {
        self.shape.block_size
    }

    fn observer(&self) -> &dyn Observer {
        match self.sheet {
            Some(_) => &*self.observer.0,
            None => &(),
        }
    }

    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
    }

    fn variances(&self) -> Vec<f64> {
        let mut transport = lock(&self.transport);
        let last = transport.rig().and_then(|rig| rig.measurement.last_product());
        last.map_or_else(Vec::new, |product| product.variance.clone())
    }

    fn common_error(&mut self, x: &[f64]) -> Result<f64> {
        lock(&self.transport).common_error((self.part, self.channel), x)
    }

    fn frames(&self) -> Option<u64> {
        Some(lock(&self.transport).rig()?.measurement.effort().frames())
    }

    fn vectors(&self, columns: usize, selection: Option<Selection<'_>>) -> Result<Option<Box<dyn Vectors>>> {
        lock(&self.transport).vectors((self.part, self.channel), columns, selection)
    }

    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        let of = ((self.part, self.channel), self.is_confirming);
        let seen = self.sheet.is_some() && !self.is_confirming;
        let product = lock(&self.transport).product_within(of, vectors, (column, direction), seen)?;
        self.errors.clear();
        self.photos += usize::from(!self.is_confirming);
        let Some(Product { from, to }) = product.filter(|_| seen) else { return Ok(()) };
        if self.show(&from, &to, direction == Direction::Adjoint)? { Ok(()) } else { Err(Error::Interrupted) }
    }

    fn confirming(&mut self, on: bool) -> bool {
        let is_free = self.is_free();
        self.is_confirming = on && is_free;
        is_free
    }

    fn claim(&mut self, question: &str) -> Result<Option<Vec<u8>>> {
        lock(&self.transport).claim((self.part, self.channel), question)
    }

    fn keep_claim(&mut self, question: &str, claim: &[u8]) -> Result<()> {
        lock(&self.transport).keep_claim((self.part, self.channel), question, claim)
    }
}

impl Adjoint for LabOperator {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.products(Direction::Adjoint, ys, xs)
    }
}
