//! The lists of the tiles of several instants; the twin of [`crate::cpu::exposure::intersect_instants`].
//!
//! The rows of all instants are first listed together, so that a tile's list holds every row that touches it at any
//! instant, by depth, then by number in the scene. Each list to be drawn is a part of its tile's: the rows that stand
//! still, and those that move at the list's instant, in the same order. Steps: sort the pairs of all rows into tiles;
//! count the pairs of each instant in every tile, which tells the lists to be drawn; count the lists in which each pair
//! stands; write each list and its places in the list by row.

mod kernels;

use kernels::{
    arrange_kernel, class_count_kernel, copy_count_kernel, drawn_kernel, entry_kernel, extra_count_kernel, fill_kernel,
    offset_kernel, target_kernel,
};

use cubecl::prelude::*;

use super::lists::{ByTile, Counted, Found, by_tile, count_tiles, intersect, usable_room};
use crate::config::{Room, tile_grid};
use crate::cube::buffer::{Buffer, cube_dim, grid, grid_for};
use crate::cube::error::CubeError;
use crate::cube::scan::exclusive_scan;
use crate::rows::PROJECTED;

/// A table of rows: `scene` rows at the first instant, then the rows `moving` at each further one.
#[derive(Clone, Copy)]
pub struct InstantRows<'a> {
    /// `[R, 8]`
    pub projected: &'a Buffer,
    /// `[R]`
    pub opacities: &'a Buffer,
    /// `[R, C]`
    pub features: &'a Buffer,
    /// Rows of the scene.
    pub scene: usize,
    /// Row numbers below `scene`, `[M]`; `R = scene + further instants * M`. They must ascend: nothing checks it, and
    /// kernels index by them.
    pub moving: &'a Buffer,
}

/// The lists to be drawn; `T` is their number, or the room for them, and `P` that of their pairs.
#[derive(Clone, Debug)]
pub struct FoundInstants {
    /// `[T + 1]`
    pub tile_offsets: Buffer,
    /// `[P]`, by list, then depth, then number in the scene.
    pub gaussian_ids: Buffer,
    /// `[R + 1]`
    pub gaussian_offsets: Buffer,
    /// `[P]`, by row.
    pub positions: Buffer,
    /// The image's tile of each list, `[T]`.
    pub places: Buffer,
    /// `[grid + 1]` offsets of the further lists of each tile of the image, then `[T]` numbers of instants; see
    /// [`TileShares`](crate::cpu::exposure::TileShares).
    pub shares: Buffer,
    /// If room was used, `[2]` each, `f32`: the higher and the lower 16 bits of the number of pairs, and of the number
    /// of lists.
    pub words: Option<[Buffer; 2]>,
}

/// Lists for all instants of a table of rows, as [`crate::cpu::exposure::intersect_instants`] makes them.
///
/// Without `room` the numbers of pairs and lists are read back. With it nothing waits for the device: there are as many
/// lists as there is room for, the last ones empty, and with too little room all lists are empty. Room that does not
/// fit into a buffer is not used.
///
/// # Errors
/// As [`intersect`].
///
/// # Panics
/// When the buffers disagree in length.
pub fn intersect_instants(
    client: &Client,
    table: InstantRows,
    size: [u32; 2],
    channels: usize,
    room: Option<Room>,
) -> Result<FoundInstants, CubeError> {
    let InstantRows { projected, opacities, features, scene, moving } = table;
    let (rows, movers) = (projected.len() / PROJECTED, moving.len());
    assert!(
        rows >= scene && (rows - scene).is_multiple_of(movers.max(1)),
        "rows must be [scene + instants * moving], {rows} are not {scene} + instants * {movers}"
    );
    let further = (rows - scene).checked_div(movers).unwrap_or(0);
    let (columns, tile_rows) = tile_grid(size[0], size[1]);
    let grid_tiles = columns * tile_rows;
    if further == 0 {
        let room = room.map(|room| room.pairs);
        let found = intersect(client, projected, opacities, features, size, channels, room)?;
        return of_one_instant(client, found, grid_tiles);
    }
    let pairs_room = usable_room(client, room.map(|room| room.pairs));
    // Without room for the pairs their number is read, and the number of lists with it.
    let room = room.filter(|_| pairs_room.is_some());
    let counted = count_tiles(client, projected, opacities, features, size, channels)?;
    let (counted, classes) = arranged(client, counted, moving, scene, further)?;
    let base = by_tile(client, projected, opacities, counted, size, pairs_room)?;
    let extended = Extended::of(client, &base, &classes, further, grid_tiles)?;
    let room = match room {
        Some(room) => Room { pairs: room.pairs, tiles: room.tiles.max(grid_tiles) },
        None => extended.counted(client, &base, grid_tiles)?,
    };
    let found = extended.lists(client, &base, further, grid_tiles, room)?;
    Ok(FoundInstants { words: found.words.filter(|_| pairs_room.is_some()), ..found })
}

/// The lists of a table that has no rows of further instants: the image's tiles, each for the one instant.
fn of_one_instant(client: &Client, found: Found, grid_tiles: usize) -> Result<FoundInstants, CubeError> {
    let places: Vec<u32> = (0..grid_tiles as u32).collect();
    let mut shares = vec![0_u32; grid_tiles + 1];
    shares.resize(2 * grid_tiles + 1, 1);
    let lists = [(grid_tiles >> 16) as f32, (grid_tiles & 0xffff) as f32];
    let words = match found.words {
        Some(pairs) => Some([pairs, Buffer::upload(client, "number of lists", &lists)?]),
        None => None,
    };
    Ok(FoundInstants {
        tile_offsets: found.lists.tile_offsets,
        gaussian_ids: found.lists.gaussian_ids,
        gaussian_offsets: found.lists.gaussian_offsets,
        positions: found.lists.positions,
        places: Buffer::upload(client, "tiles of lists", &places)?,
        shares: Buffer::upload(client, "shares of tiles", &shares)?,
        words,
    })
}

/// The counted rows in the order of their numbers in the scene, and the class of each row.
fn arranged(
    client: &Client,
    counted: Counted,
    moving: &Buffer,
    scene: usize,
    further: usize,
) -> Result<(Counted, Buffer), CubeError> {
    let rows = counted.counts.len();
    let keys = Buffer::empty(client, "depth keys in the order of the scene", rows)?;
    let ids = Buffer::empty(client, "rows in the order of the scene", rows)?;
    let classes = Buffer::empty(client, "classes of rows", rows)?;
    arrange_kernel::launch(
        client,
        grid_for(rows),
        cube_dim(),
        counted.keys.arg(),
        moving.arg(),
        keys.arg(),
        ids.arg(),
        classes.arg(),
        rows as u32,
        scene as u32,
        moving.len() as u32,
        further as u32,
    );
    Ok((Counted { counts: counted.counts, keys, ids }, classes))
}

/// The pairs of all rows, and what they become in the lists to be drawn.
struct Extended {
    /// Row, class and slot of each pair in tile order: three parts of `pairs` values.
    entries: Buffer,
    entry_starts: [usize; 3],
    /// `[grid, further + 2]`: pairs of each class.
    table: Buffer,
    /// `[grid + 1]`
    extra_offsets: Buffer,
    /// Copies of the pairs in slots before each, `[pairs + 1]`.
    copy_offsets: Buffer,
}

impl Extended {
    fn of(
        client: &Client,
        base: &ByTile,
        classes: &Buffer,
        further: usize,
        grid_tiles: usize,
    ) -> Result<Self, CubeError> {
        let pairs = base.slots.len();
        let (still, class_count) = (further as u32 + 1, further + 2);
        let entries = Buffer::slab(client, "pairs of all instants", [pairs; 3])?;
        let starts = entries.starts.map(|start| start as u32);
        let table = Buffer::empty(client, "pairs of each instant", grid_tiles * class_count)?;
        let extras = Buffer::empty(client, "further lists of tiles", grid_tiles)?;
        let copies = Buffer::empty(client, "copies of pairs", pairs)?;
        // SAFETY: slots are a permutation of the pairs, owners are rows, and offsets of tiles end at the last pair; the
        // table has a row for each tile of the image.
        unsafe {
            if pairs > 0 {
                entry_kernel::launch_unchecked(
                    client,
                    grid_for(pairs),
                    cube_dim(),
                    base.slots.arg(),
                    base.owners.arg(),
                    classes.arg(),
                    entries.whole.arg(),
                    pairs as u32,
                    starts[1],
                    starts[2],
                );
            }
            class_count_kernel::launch_unchecked(
                client,
                grid(grid_tiles),
                cube_dim(),
                entries.whole.arg(),
                base.tile_offsets.arg(),
                table.arg(),
                grid_tiles as u32,
                class_count as u32,
                starts[1],
            );
            extra_count_kernel::launch_unchecked(
                client,
                grid_for(grid_tiles),
                cube_dim(),
                table.arg(),
                extras.arg(),
                grid_tiles as u32,
                still,
            );
        }
        let extra_offsets = exclusive_scan(client, &extras, grid_tiles + 1)?;
        if pairs > 0 {
            // SAFETY: as above; tiles of pairs are compared with the grid before they are used.
            unsafe {
                copy_count_kernel::launch_unchecked(
                    client,
                    grid_for(pairs),
                    cube_dim(),
                    entries.whole.arg(),
                    base.tiles.arg(),
                    extra_offsets.arg(),
                    copies.arg(),
                    pairs as u32,
                    grid_tiles as u32,
                    still,
                    starts[1],
                    starts[2],
                );
            }
        }
        let copy_offsets = exclusive_scan(client, &copies, pairs + 1)?;
        let entry_starts = entries.starts;
        Ok(Self { entries: entries.whole, entry_starts, table, extra_offsets, copy_offsets })
    }

    /// The exact room, read from the device.
    fn counted(&self, client: &Client, base: &ByTile, grid_tiles: usize) -> Result<Room, CubeError> {
        let last = |buffer: &Buffer| -> Result<u32, CubeError> {
            Ok(buffer.part(buffer.len() - 1, 1).download::<u32>(client)?[0])
        };
        let pairs = u64::from(last(&base.gaussian_offsets)?) + u64::from(last(&self.copy_offsets)?);
        if pairs > i32::MAX as u64 {
            return Err(CubeError::TooManyIntersections);
        }
        Ok(Room { pairs: pairs as usize, tiles: grid_tiles + last(&self.extra_offsets)? as usize })
    }

    fn lists(
        &self,
        client: &Client,
        base: &ByTile,
        further: usize,
        grid_tiles: usize,
        room: Room,
    ) -> Result<FoundInstants, CubeError> {
        let (rows, base_pairs) = (base.gaussian_offsets.len() - 1, base.slots.len());
        let (still, grid_u32) = (further as u32 + 1, grid_tiles as u32);
        let Room { pairs, tiles } = room;
        let extras = tiles - grid_tiles;
        let drawn = Buffer::slab(client, "lists of tiles", [tiles; 3])?;
        let drawn_starts = drawn.starts.map(|start| start as u32);
        let shares = Buffer::empty(client, "shares of tiles", grid_tiles + 1 + tiles)?;
        let offsets = Buffer::empty(client, "offsets of rows", rows + 1)?;
        let words = Buffer::slab(client, "numbers of pairs and lists", [2; 2])?;
        let targets = Buffer::slab(client, "places of pairs by row", [base_pairs; 2])?;
        let lists = Buffer::slab(client, "pairs of all lists", [pairs; 2])?;
        // SAFETY: offsets of rows, slots and tiles end at the `base_pairs`; all that is written is below the room,
        // since lists without room are empty; the parts of each slab are as long as their kernels index them.
        unsafe {
            drawn_kernel::launch_unchecked(
                client,
                grid_for(grid_tiles.max(extras)),
                cube_dim(),
                self.table.arg(),
                base.gaussian_offsets.arg(),
                self.copy_offsets.arg(),
                self.extra_offsets.arg(),
                drawn.whole.arg(),
                shares.arg(),
                rows as u32,
                base_pairs as u32,
                grid_u32,
                still,
                pairs as u32,
                extras as u32,
                drawn_starts[1],
                drawn_starts[2],
            );
            offset_kernel::launch_unchecked(
                client,
                grid_for(rows + 1),
                cube_dim(),
                base.gaussian_offsets.arg(),
                self.copy_offsets.arg(),
                self.extra_offsets.arg(),
                base.words.arg(),
                offsets.arg(),
                words.whole.arg(),
                rows as u32,
                base_pairs as u32,
                grid_u32,
                pairs as u32,
                extras as u32,
                words.starts[1] as u32,
            );
            if base_pairs.max(pairs) > 0 {
                target_kernel::launch_unchecked(
                    client,
                    grid_for(base_pairs.max(pairs)),
                    cube_dim(),
                    self.entries.arg(),
                    base.gaussian_offsets.arg(),
                    self.copy_offsets.arg(),
                    base.tile_offsets.arg(),
                    offsets.arg(),
                    targets.whole.arg(),
                    lists.whole.arg(),
                    rows as u32,
                    base_pairs as u32,
                    pairs as u32,
                    grid_u32,
                    self.entry_starts[2] as u32,
                    targets.starts[1] as u32,
                    lists.starts[1] as u32,
                );
            }
        }
        let [places, _, lengths] = drawn.parts;
        let tile_offsets = exclusive_scan(client, &lengths, tiles + 1)?;
        // SAFETY: as above; a list's rows are as many as its length says, since both follow from the same classes.
        unsafe {
            fill_kernel::launch_unchecked(
                client,
                grid(tiles),
                cube_dim(),
                self.entries.arg(),
                targets.whole.arg(),
                base.tile_offsets.arg(),
                drawn.whole.arg(),
                tile_offsets.arg(),
                shares.arg(),
                lists.whole.arg(),
                tiles as u32,
                grid_u32,
                still,
                self.entry_starts[1] as u32,
                targets.starts[1] as u32,
                drawn_starts[1],
                lists.starts[1] as u32,
            );
        }
        let [gaussian_ids, positions] = lists.parts;
        Ok(FoundInstants {
            tile_offsets,
            gaussian_ids,
            gaussian_offsets: offsets,
            positions,
            places,
            shares,
            words: Some(words.parts),
        })
    }
}
