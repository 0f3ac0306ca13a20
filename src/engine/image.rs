//! Balls as their neighbours see them: a number, and at which image across the faces of a periodic box.

/// A ball or piece by its number, and which image of it.
pub type Seen = u32;

/// Bits above these say which image it is: `x + 3 y + 9 z` for one moved by `x, y, z` boxes, -1 being counted as 2.
pub const IMAGE_SHIFT: u32 = 27;

/// Images that can be told apart.
pub const IMAGES: usize = 27;

/// The number without the image.
#[inline(always)]
pub fn number_of(seen: Seen) -> u32 {
    seen & ((1 << IMAGE_SHIFT) - 1)
}

/// The image's number.
#[inline(always)]
pub fn image_of(seen: Seen) -> usize {
    (seen >> IMAGE_SHIFT) as usize
}

/// Steps by whole boxes that an image's number stands for.
#[inline]
pub fn steps_of(image: usize) -> [i8; 3] {
    STEPS[image]
}

/// [`steps_of`] every image.
const STEPS: [[i8; 3]; IMAGES] = {
    let (mut steps, step) = ([[0; 3]; IMAGES], [0, 1, -1]);
    let mut image = 0;
    while image < IMAGES {
        steps[image] = [step[image % 3], step[image / 3 % 3], step[image / 9]];
        image += 1;
    }
    steps
};

/// The number of the image that is so many steps away.
#[inline]
pub fn image_at(steps: [i8; 3]) -> u32 {
    let [x, y, z] = steps.map(|step| {
        if step < 0 {
            2
        } else {
            step.cast_unsigned().into()
        }
    });
    x + 3 * y + 9 * z
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_image_has_its_number() {
        for image in 0..IMAGES {
            assert_eq!(image_at(steps_of(image)) as usize, image);
            let seen = 0x3039 | (image as u32) << IMAGE_SHIFT;
            assert_eq!((number_of(seen), image_of(seen)), (0x3039, image));
        }
    }
}
