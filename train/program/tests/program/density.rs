//! Density control: the cap holds, and every column of a Gaussian stays with its Gaussian.

use crate::common;

use std::collections::BTreeMap;

use burn::module::Module;
use burn::tensor::Tensor;
use glam::DMat4;
use gs_base::Intrinsics;
use gs_burn::adam::{Adam, Moments};
use gs_burn::{Camera, Gaussians, NamedGradients, RenderOptions, render};
use gs_splats::{Merged, Splats};
use gs_train::config::{DensityConfig, McmcConfig};
use gs_train::fit::density::ops::{Draft, logit};
use gs_train::fit::density::{Control, StepContext, mcmc, prune};
use gs_train::fit::parameters::{Group, Table, from_host, gaussians, to_host};
use gs_train::fit::photos::camera;
use gs_train::run::exchange::host::{gaussians_of, splats_of};
use gs_train::run::folder::MetricsLine;

/// A table in which every number tells its row: row r of a column group holds r + column / 100.
fn labelled(rows: usize, offset: f32) -> [Tensor<2>; 5] {
    Group::ALL.map(|group| {
        let columns = group.columns(1);
        let values =
            (0..rows * columns).map(|i| offset + (i / columns) as f32 + (i % columns) as f32 / 100.0).collect();
        from_host(values, columns, &common::device())
    })
}

fn table(rows: usize) -> (Gaussians, Adam) {
    let [first, second] = [1000.0, 2000.0].map(|offset| labelled(rows, offset));
    let moments = first.into_iter().zip(second).map(|(first, second)| Moments { first, second });
    let paths = Group::ALL.map(|group| group.path().to_string());
    let moments: BTreeMap<String, Moments> = paths.into_iter().zip(moments).collect();
    (gaussians(labelled(rows, 0.0)), Adam { moments, updates: 5 })
}

/// The row each row of a group came from, read from its first column.
fn origins(tensor: &Tensor<2>, offset: f32) -> Vec<f32> {
    let columns = tensor.dims()[1];
    to_host(tensor.clone()).iter().step_by(columns).map(|x| if *x == 0.0 { -1.0 } else { x - offset }).collect()
}

#[test]
fn rows_stay_together() {
    let (mut gaussians, mut adam) = table(6);
    let mut draft = Draft::read(&gaussians);
    let copy = draft.duplicate(2);
    draft.overwrite(1, 4);
    draft.forget(5);
    draft.retain(|_, row| row != 3);
    assert_eq!((copy, draft.len()), (6, 6));
    draft.commit(&mut gaussians, &mut adam);

    let from = [0.0, 4.0, 2.0, 4.0, 5.0, 2.0];
    for group in [Group::Quats, Group::Sh, Group::Means, Group::LogScales, Group::Opacity] {
        // Row 0 holds 0 in its first column, which origins() takes for a cleared moment.
        let found: Vec<f32> = origins(&gaussians.group(group), 0.0).iter().map(|row| row.max(0.0)).collect();
        assert_eq!(found, from, "{}", group.name());
        // Moments of the kept rows follow; those of copies, receivers and forgotten rows are zero.
        let kept = [0.0, -1.0, 2.0, 4.0, -1.0, -1.0];
        assert_eq!(origins(&adam.moments[group.path()].first, 1000.0), kept, "{}", group.name());
        assert_eq!(origins(&adam.moments[group.path()].second, 2000.0), kept, "{}", group.name());
    }
    let sh = gaussians.read(Group::Sh);
    assert!(
        sh[0..12].iter().enumerate().all(|(column, x)| (x - column as f32 / 100.0).abs() < 1e-6),
        "all columns move"
    );
}

#[test]
fn a_draft_that_changes_nothing_changes_nothing() {
    let (mut gaussians, mut adam) = table(4);
    let (before, moments) =
        (Group::ALL.map(|g| gaussians.read(g)), origins(&adam.moments[Group::Sh.path()].first, 1000.0));
    Draft::read(&gaussians).commit(&mut gaussians, &mut adam);
    assert_eq!(before, Group::ALL.map(|g| gaussians.read(g)));
    assert_eq!(moments, origins(&adam.moments[Group::Sh.path()].first, 1000.0));
}

fn context() -> StepContext {
    StepContext { step: 100, steps: 1000, seed: 3, extent: 1.0, means_lr: 1e-4, control: Control::Scheduled }
}

fn with_opacities(opacities: &[f64]) -> (Gaussians, Adam) {
    let (mut gaussians, adam) = table(opacities.len());
    let logits = opacities.iter().map(|o| logit(*o) as f32).collect();
    gaussians.set(Group::Opacity, from_host(logits, 1, &common::device()));
    (gaussians, adam)
}

fn with(mcmc: McmcConfig) -> DensityConfig {
    DensityConfig { mcmc, ..DensityConfig::default() }
}

#[test]
fn the_dead_move_onto_the_living_and_the_image_stays() {
    let (mut gaussians, mut adam) = with_opacities(&[0.001, 0.9, 0.002, 0.003]);
    let config = with(McmcConfig { growth: 0.0, separation: 0.0, ..McmcConfig::default() });
    let changes = mcmc::refine(&mut gaussians, &mut adam, &config, &context()).changes;
    assert_eq!((changes.moved, changes.added, gaussians.len()), (3, 0, 4));
    let transmittance: f64 = gaussians
        .read(Group::Opacity)
        .iter()
        .map(|x| 1.0 - gs_train::fit::density::ops::sigmoid(f64::from(*x)))
        .product();
    assert!((1.0 - transmittance - 0.9).abs() < 1e-5, "four coincident Gaussians blend to the one before");
    assert_eq!(origins(&gaussians.group(Group::Means), 0.0), [1.0; 4]);
}

#[test]
fn nothing_is_drawn_from_a_scene_of_dead_gaussians() {
    let (mut gaussians, mut adam) = with_opacities(&[0.001, 0.002]);
    let config = with(McmcConfig { growth: 0.5, ..McmcConfig::default() });
    // Growth still draws by opacity; relocation has nobody to move onto.
    let changes = mcmc::refine(&mut gaussians, &mut adam, &config, &context()).changes;
    assert_eq!((changes.moved, changes.added), (0, 1));
}

#[test]
fn numbers_that_are_none_neither_stop_nor_spread() {
    let (mut gaussians, mut adam) = with_opacities(&[0.5, 0.001, 0.4]);
    let mut logits = gaussians.read(Group::Opacity);
    logits[1] = f32::NAN;
    gaussians.set(Group::Opacity, from_host(logits, 1, &common::device()));
    let mut quats = gaussians.read(Group::Quats);
    quats[0..4].fill(f32::NAN);
    gaussians.set(Group::Quats, from_host(quats, 4, &common::device()));
    mcmc::perturb(&mut gaussians, 5e5, &context());
    let config = with(McmcConfig { growth: 0.0, ..McmcConfig::default() });
    mcmc::refine(&mut gaussians, &mut adam, &config, &context());
    assert!(gaussians.read(Group::Opacity).iter().all(|x| x.is_finite()), "the dead NaN was given a living place");
    assert!(gaussians.read(Group::Means).iter().all(|x| x.is_finite()));
}

fn counts_under(cap: usize, overrides: &[&str]) -> Vec<usize> {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = common::tiny_scene(folder.path());
    let cap = format!("density.cap={cap}");
    let common_overrides = ["density.start=2", "density.every=2", "density.stop=1", &cap];
    let overrides: Vec<&str> = common_overrides.iter().chain(overrides).copied().collect();
    let job = common::job(&scene, &folder.path().join("run"), &common::config(40, &overrides));
    let eval = common::finish(&job);
    let lines = job.folder.read_metrics(40).expect("metrics");
    let train = lines.iter().filter_map(|line| match line {
        MetricsLine::Train(line) => Some(line.counts["Gaussians"] as usize),
        MetricsLine::Eval(_) => None,
    });
    train.chain([eval.last.measured.size.gaussians]).collect()
}

#[test]
fn the_cap_is_never_exceeded() {
    for (strategy, greedy) in [
        ("density.strategy=mcmc", "density.mcmc.growth=0.9"),
        ("density.strategy=default", "density.default.gradient=1e-9"),
    ] {
        let counts = counts_under(230, &[strategy, greedy, "density.min_opacity=1e-6"]);
        assert!(counts.iter().all(|count| *count <= 230), "{strategy}: {counts:?}");
        assert_eq!(counts.last(), Some(&230), "{strategy} fills the budget");
    }
}

#[test]
fn the_cap_holds_from_the_start() {
    assert!(counts_under(common::POINTS / 3, &[]).iter().all(|count| *count <= common::POINTS / 3));
}

/// At each pixel the blending weights add up to the alpha, so those of all Gaussians do to the alpha of all photos.
#[test]
fn contributions_add_up_to_what_is_seen() {
    let begun = common::begun(&common::config(10, &[]));
    let views = &begun.data.scene.train;
    let model = begun.trainer.scene();
    let facts = gs_train::fit::facts::SceneFacts { background: [0.0; 3], ..begun.data.facts };
    let options = facts.render_options(&begun.config.render, 0);
    let contributions = prune::contributions(&*model, views, &options, begun.config.seed);
    let gaussians = model.at(0.0);
    let alpha = |view| to_host(gs_burn::render(&gaussians, &camera(view, &common::device()), &options).alpha);
    let seen: f64 = views.iter().flat_map(alpha).map(f64::from).sum();
    let sum: f64 = contributions.iter().sum();
    assert_eq!(contributions.len(), gaussians.len());
    assert!(seen > 1000.0 && (sum / seen - 1.0).abs() < 1e-4, "{sum} of {seen}");
}

/// Gaussians out of sight when the count comes to rest are dropped then, and no others later.
#[test]
fn what_no_photo_shows_is_dropped() {
    let mut begun =
        common::begun(&common::config(20, &["density.prune_share=0.001", "density.stop=0.5", "density.mcmc.noise=0"]));
    let mut counts = Vec::new();
    for step in 1..=20 {
        if step == 10 {
            begun.trainer.change(|mut model, _| {
                let mut means = model.gaussians.read(Group::Means);
                means[..9].fill(1e4);
                model.gaussians.set(Group::Means, from_host(means, 3, &common::device()));
                model
            });
        }
        begun.step();
        counts.push(begun.trainer.gaussians().len());
    }
    let means = begun.trainer.gaussians().read(Group::Means);
    assert!(means.iter().all(|x| x.abs() < 1e3), "the three are gone");
    let least = counts[8] * 9 / 10;
    assert!(counts[9] + 3 <= counts[8] && counts[9] > least, "{counts:?}: few others added so little");
    assert!(counts[9..].iter().all(|count| *count == counts[9]), "{counts:?}");
}

/// Thresholds that no Gaussian passes would end a run with nothing to learn.
#[test]
fn the_last_gaussians_are_not_removed() {
    let mut begun = common::begun(&common::config(
        6,
        &["density.strategy=default", "density.min_opacity=0.9", "density.start=1", "density.every=2"],
    ));
    let before = begun.trainer.gaussians().len();
    for _ in 0..6 {
        assert!(!begun.step().skipped);
    }
    assert!(begun.trainer.gaussians().len() >= before);
}

/// A table without rows has gradients without rows.
#[test]
fn an_empty_table_has_empty_gradients() {
    let empty = gaussians(Group::ALL.map(|group| from_host(Vec::new(), group.columns(1), &common::device())));
    let tracked = empty.train();
    let mut gradients = (tracked.means.val().sum() + tracked.sh.val().sum()).backward();
    let mut gradients = NamedGradients::take(&tracked, &mut gradients);
    let shapes = Group::ALL.map(|group| gradients.remove(group.name()).expect("a gradient").dims());
    assert_eq!(shapes, Group::ALL.map(|group| [0, group.columns(1)]));
}

/// A wall of small Gaussians apart from each other, in front of a camera at the origin.
fn wall() -> Gaussians {
    let wave = |i: usize, k: usize| ((13 * i + 7 * k) as f32 * 0.731).sin();
    let splats = Splats {
        means: (0..25).map(|i| [(i % 5) as f32 - 2.0, (i / 5) as f32 - 2.0, 6.0]).collect(),
        quats: (0..25).map(|i| [1.5, wave(i, 0), wave(i, 1), wave(i, 2)]).collect(),
        log_scales: vec![[0.2_f32.ln(), 0.12_f32.ln(), 0.06_f32.ln()]; 25],
        opacity_logits: (0..25).map(|i| wave(i, 3)).collect(),
        sh: (0..25).map(|i| [wave(i, 4), wave(i, 5), wave(i, 6)]).collect(),
        ..Splats::default()
    };
    gaussians_of(&splats, &common::device())
}

/// Each Gaussian in two, as growth does it, and merged again: near what it was, and in the same picture.
#[test]
fn what_growth_split_merges_back() {
    let before = wall();
    let (mut split, all) = (before.clone(), (0..25).collect::<Vec<usize>>());
    let mut draft = Draft::read(&split);
    draft.share_out(&all, 0.0);
    let means = draft.spread_out(&all, &split.read(Group::Quats), McmcConfig::default().separation);
    for (row, mean) in all.iter().zip(means) {
        let copy = draft.duplicate(*row);
        draft.means[copy] = mean;
    }
    draft.commit(&mut split, &mut Adam::new());
    let split = splats_of(&split, None);
    let mut merged = Merged::of(&split, &[1.0; 50], &[]);
    merged.reduce(25);
    assert_eq!(merged.rows, (0..25).collect::<Vec<u32>>(), "each has its own copy");

    let (old, new) = (splats_of(&before, None), merged.splats);
    let sorted = |mut scales: [f32; 3]| {
        scales.sort_by(f32::total_cmp);
        scales
    };
    for row in 0..25 {
        let apart = (0..3).map(|k| (old.means[row][k] - new.means[row][k]).abs()).fold(0.0, f32::max);
        let [old_scales, new_scales] = [&old, &new].map(|splats| sorted(splats.log_scales[row]));
        let grown = (0..3).map(|k| (old_scales[k] - new_scales[k]).abs()).fold(0.0, f32::max);
        assert!(apart < 1e-5 && grown < 0.1, "{row}: {apart} units apart, {grown}");
        assert_eq!(old.sh[row], new.sh[row]);
    }
    let intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 64.0, cy: 64.0 };
    let camera = Camera::from_c2w(DMat4::IDENTITY, intrinsics, 128, 128, &common::device());
    let image = |gaussians: &Gaussians| to_host(render(gaussians, &camera, &RenderOptions::default()).color);
    let truth = image(&before);
    let psnr = |splats: &Splats| {
        let squares = image(&gaussians_of(splats, &common::device()))
            .iter()
            .zip(&truth)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f32>();
        -10.0 * (squares / truth.len() as f32).log10()
    };
    let half = split.select(&(0..25).collect::<Vec<u32>>());
    let [merged, left_out] = [psnr(&new), psnr(&half)];
    assert!(merged > 42.0 && merged > left_out + 8.0, "{merged} dB merged, {left_out} dB left out");
}
