//! Example commands in the program's help; they are here because they name pipelines and recipes.

/// Shown below `gsburn --help`.
pub const PROGRAM: &str = "\
Examples:
  gsburn demo                                       blurry video to a sharp moving scene on the CPU, with a report
  gsburn check my-photos                            what is in a data set, and what is wrong with it
  gsburn train my-photos --set data.max_width=800   photos with poses (COLMAP or transforms.json) to Gaussians
  gsburn train --resume --out runs/my-photos        continue after Ctrl-C or a power cut
  gsburn synth deblur sphere --out sphere           blurry multi-view video with known truth
  gsburn train sphere --recipe taylormode/base
  gsburn render runs/my-photos --cameras path/transforms.json --out frames
  gsburn view runs/my-photos                        one page with the scene in 3D; gsburn watch shows it in training
  gsburn export runs/my-photos --out scene.ply
  gsburn extrapolate runs/my-video --to 1.5         frames after the recording, of a run that moves";

/// Shown below `gsburn import --help`.
pub const IMPORT: &str = "\
Examples:
  gsburn import arrays --into fan                            priors/depth in fan, read from then on
  gsburn import arrays --into my-photos --out my-photos-depth --kind inverse_depth

Each photo's depth is fitted by a scale and a shift to the points of the data set; a fifth of wrong points does no harm.
Of an archive or a dictionary of a network a line of Python makes the files:
  for name, depth in zip(names, predictions['depth']): numpy.save(f'arrays/{name}.npy', depth)";

/// Shown below `gsburn sweep --help`.
pub const SWEEP: &str = "\
Examples:
  gsburn sweep cube --recipe taylormode/base \\
      --over blur.samples=3,7,15 --over density.cap=5000,10000 --out runs/cube-sweep
  gsburn sweep cube --recipes taylormode/paper,taylormode/itg,taylormode/base --set steps=2000 --out runs/methods
  gsburn sweep fan --set pipeline=sparsedyn --one-at-a-time \\
      --over dynamics.step_frames=1,4 --over dynamics.ask=step,stage --out runs/fan-cost
  gsburn sweep fan --set pipeline=sparsedyn --set data.train_cameras=5 --choose smallest --out runs/fan-size
  gsburn sweep door fox --recipe static/lund-door,static/fox \\
      --over seed=42,43,44 --set 'eval.at=[100,300,1000,3000]' --out runs/time

--choose smallest measures the runs on the validation images and chooses the smallest scene within one standard error
of the best; choice.md says what it saves and what it costs. The reported split takes no part in the choice.

One run for every combination, one after another, each in a folder of --out that is named after it; then chart.svg,
chart.md and chart.csv with all of them. Of several data sets each has such a folder in --out. The same command again
continues: finished runs are kept, an interrupted one goes on from its newest checkpoint. Ctrl-C saves a checkpoint and
leaves with exit code 130, SIGTERM likewise with 143.";

/// Shown below `gsburn flow --help`.
pub const FLOW: &str = "\
Examples:
  gsburn flow pandaset/002
  gsburn flow av2/val/LOG --out flow              one array a sweep: [points, 3], metres in 0.1 s, axes of the world
  gsburn flow av2/val/LOG --protocol av2          scored without ground, within 50 and 35 m
  gsburn flow av2/val/LOG --fit 500               the baseline: a fit of every pair of sweeps, minutes a sweep

Bodies are found by what the rays of other sweeps passed through; each has one motion in the plane (velocity,
acceleration, turn), and all else rests. Points without a label are not scored. 'gsburn reconstruct' starts from the
same motions.";

/// Shown below `gsburn reconstruct --help`.
pub const RECONSTRUCT: &str = "\
Examples:
  gsburn synth driving --logs 4 --frames 22 --out streets
  gsburn train streets --recipe flux4d/base --out runs/streets
  gsburn reconstruct streets/003 --model runs/streets --out out     one snippet: frames between the inputs, actors, PLY
  gsburn reconstruct pandaset/002 --model runs/streets --full --out whole
  gsburn reconstruct streets/003 --model runs/streets --future 5 --times 0.25,0.55 --shift 0,2,1 --out moved
  gsburn reconstruct streets/003 --model runs/streets --polish 100 --out polished
  gsburn reconstruct streets/003 --model runs/streets --edit edits.toml --out edited

Edits name actors by their numbers in actors.json:
  [[edits]]
  do = \"move\"                # or remove, insert, recolor
  actor = 0
  offset = [0.0, 3.0, 0.0]   # metres: forward, left, up of the vehicle
  turn = 90.0                # degrees";
