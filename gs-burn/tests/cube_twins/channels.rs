//! Channels of an image, and back.

use gs_kernels::cube::channels;

use super::support::{client, down, up};

#[test]
fn there_and_back() {
    let image: Vec<f32> = (0..300 * 5).map(|k| k as f32).collect();
    for (first, count) in [(0, 3), (3, 1), (4, 1), (0, 5)] {
        let part = channels::forward(client(), &up(&image), 5, first, count).expect("forward");
        let want: Vec<f32> = image.chunks(5).flat_map(|pixel| &pixel[first..first + count]).copied().collect();
        assert_eq!(down(&part), want);
        let back = down(&channels::backward(client(), &part, 5, first, count).expect("backward"));
        for (k, value) in back.into_iter().enumerate() {
            let kept = (first..first + count).contains(&(k % 5));
            assert_eq!(value, if kept { image[k] } else { 0.0 });
        }
    }
}
