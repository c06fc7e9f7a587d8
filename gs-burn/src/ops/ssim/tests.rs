use super::*;
use crate::testing::{Random, assert_close, assert_same_gradients, gradient_of};

#[test]
fn kernel_is_the_reference() {
    for [height, width, channels] in [[23, 31, 3], [5, 40, 1], [1, 1, 3], [12, 4, 2]] {
        let mut random = Random(8);
        let image = random.tensor([height, width, channels], 0.0, 1.0).require_grad();
        let target = random.tensor([height, width, channels], 0.0, 1.0).require_grad();
        assert_same_gradients(
            l1_ssim(image.clone(), target.clone()),
            l1_ssim_reference(image.clone(), target.clone()),
            &[("image", &gradient_of(&image)), ("target", &gradient_of(&target))],
        );
    }
}

#[test]
fn strided_images_are_read_as_they_are() {
    let mut random = Random(9);
    let image = random.tensor([20, 18, 4], 0.0, 1.0).require_grad();
    let target = random.tensor([18, 20, 3], 0.0, 1.0);
    let (part, turned) = (|| image.clone().narrow(2, 0, 3), target.permute([1, 0, 2]));
    assert_same_gradients(
        l1_ssim(part(), turned.clone()),
        l1_ssim_reference(part(), turned),
        &[("image", &gradient_of(&image))],
    );
}

#[test]
fn photometric_loss_mixes_both_terms() {
    let mut random = Random(10);
    let [image, target] = [(); 2].map(|()| random.tensor([9, 9, 3], 0.0, 1.0));
    let terms = l1_ssim(image.clone(), target.clone());
    let expected = terms.clone().narrow(0, 0, 1) * 0.8 + (-terms.narrow(0, 1, 1) + 1.0) * 0.2;
    assert_close("loss", &photometric_loss(image, target, 0.2), &expected, 1e-14);
}
