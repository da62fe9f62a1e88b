//! A scene of which only the part that a view shows is in memory.

use std::collections::BTreeMap;

use half::f16;

use super::{DrawnChunks, LexiFeed};
use crate::packed::{Budget, Eye, Selection};
use crate::scene::splats::Geometry;
use crate::sparse::codes::{Escapes, Indices, SparseCodes, Values};
use crate::sparse::model::Model;
use crate::support::error::Result;

/// A packed scene that is drawn within a budget: the decoded chunks of the last [look](Self::look).
///
/// ```
/// # use lexisplat::packed::{PackOptions, Packer};
/// # use lexisplat::{Limits, Sensitivity, Silent, lexi};
/// # let splats = lexisplat_sample::scene(&lexisplat_sample::SampleOptions::new(2000, 0));
/// # let sensitivity = Sensitivity::guess(&splats.geometry);
/// # let packer = Packer::new(&splats, &sensitivity, &PackOptions::default().with_layers_from(1))?;
/// # let (packed, _) = packer.pack(packer.step_for(40.0), &Silent)?;
/// # let mut file = Vec::new();
/// # lexi::LexiWriter::packed(&packed).write(&mut file, &Silent)?;
/// # let get = |range: std::ops::Range<u64>| &file[range.start as usize..range.end as usize];
/// use lexisplat::lexi::{FeedOptions, LexiFeed, StreamedScene};
/// use lexisplat::packed::{Budget, Eye};
///
/// let feed = LexiFeed::new("scene.lexi", &FeedOptions::default(), &Limits::default());
/// let mut scene = StreamedScene::new(feed);
/// for x in [-3.0, 0.0, 3.0] {
///     let eye = Eye::at([x, 0.0, -3.0]).with_forward([0.0, 0.0, 1.0]);
///     while let Some(range) = scene.wants(&eye, &Budget::default().with_splats(500_u64)) {
///         scene.feed(range.start, get(range))?; // from a disk or by HTTP
///         // The ranges that came so far may be drawn now.
///     }
///     scene.refresh()?;
///     let splats = scene.chunks().map(|(_, model)| model.len()).sum::<usize>();
///     assert!(splats > 0 && splats <= 500);
/// }
/// # Ok::<(), lexisplat::Error>(())
/// ```
#[derive(Debug)]
pub struct StreamedScene {
    feed: LexiFeed,
    drawn: DrawnChunks,
    models: BTreeMap<usize, Model>,
    /// The view and the budget of the last look at the outline.
    looked: Option<(Eye, Budget)>,
}

impl StreamedScene {
    /// Creates a scene of which nothing is in memory. `feed` takes its file.
    #[must_use]
    pub fn new(feed: LexiFeed) -> Self {
        Self { feed, drawn: DrawnChunks::default(), models: BTreeMap::new(), looked: None }
    }

    /// Returns the feed that takes the file.
    #[must_use]
    pub fn source(&self) -> &LexiFeed {
        &self.feed
    }

    /// Returns the bytes of the file to fetch next, so that the scene shows what `eye` sees within `budget`; `None` if all
    /// came. This is the start of the file first, then as after [`Self::look`].
    pub fn wants(&mut self, eye: &Eye, budget: &Budget) -> Option<std::ops::Range<u64>> {
        if self.looked != Some((*eye, *budget)) {
            self.look(eye, budget);
        }
        self.feed.wants()
    }

    /// Chooses what `eye` sees within `budget`, drops the bytes of all else, and asks for what is missing ([`LexiFeed::look`]).
    /// Decoded chunks stay as they are until [`Self::refresh`].
    pub fn look(&mut self, eye: &Eye, budget: &Budget) -> Option<Selection> {
        let selection = self.feed.look(eye, budget)?;
        self.looked = Some((*eye, *budget));
        Some(selection)
    }

    /// Takes `bytes` that are in the file from `at` on.
    ///
    /// # Errors
    /// As [`LexiFeed::feed`].
    pub fn feed(&mut self, at: u64, bytes: &[u8]) -> Result<()> {
        self.feed.feed(at, bytes)
    }

    /// Decodes the chunks of which more came, and those around which chunks of the next layer came or were dropped. Returns
    /// their numbers. Each is there as soon as its base is. Drops decoded chunks whose bytes were dropped.
    ///
    /// # Errors
    /// As [`LexiFeed::decode`].
    pub fn refresh(&mut self) -> Result<Vec<usize>> {
        let change = self.drawn.update(&self.feed, usize::MAX);
        self.models.retain(|c, _| change.removed.binary_search(c).is_err());
        for &c in &change.decoded {
            // After an error all chunks are decoded anew.
            let decoded = self.feed.decode(c).inspect_err(|_| self.drawn = DrawnChunks::default())?;
            self.models.extend(decoded.map(|model| (c, model)));
        }
        Ok(change.decoded)
    }

    /// Returns the decoded chunks, with their numbers in the [outline](LexiFeed::outline), in ascending order.
    pub fn chunks(&self) -> impl Iterator<Item = (usize, &Model)> {
        self.models.iter().map(|(c, model)| (*c, model))
    }

    /// Returns all decoded chunks as one scene; `None` if there are none.
    ///
    /// # Errors
    /// None that a file can cause: chunks of a file fit together.
    pub fn model(&self) -> Result<Option<Model>> {
        let mut models = self.chunks().map(|(_, model)| model).peekable();
        let Some(first) = models.peek() else { return Ok(None) };
        let dictionary = first.dictionary().clone();
        let (meta, record) = (first.meta().clone(), first.record().clone());
        let mut geometry = Geometry::default();
        let (mut counts, mut indices) = (Vec::new(), Indices::for_atoms(dictionary.len()));
        let (mut values, mut escapes) = (Vec::<f16>::new(), Escapes::default());
        for model in models {
            let codes = model.codes();
            let before = u32::try_from(geometry.len()).unwrap_or(u32::MAX);
            geometry.append(model.geometry().clone());
            counts.extend(codes.counts());
            match (&mut indices, codes.indices()) {
                (Indices::U8(all), Indices::U8(own)) => all.extend(own),
                (Indices::U16(all), Indices::U16(own)) => all.extend(own),
                _ => {}
            }
            if let Values::F16(own) = codes.values() {
                values.extend(own);
            }
            let own = codes.escapes();
            escapes.gaussians.extend(own.gaussians.iter().map(|gaussian| before.saturating_add(*gaussian)));
            escapes.rows.extend(&own.rows);
        }
        let codes = SparseCodes::new(&dictionary, counts, indices, Values::F16(values), escapes)?;
        Model::new(geometry, meta, dictionary, codes, record).map(Some)
    }
}
