//! Photos in order on a page: where each lies on the sheet, how large that becomes, and what stands beside it.

use krylux::image::Resolution;
use krylux::report::contact_sheet::{ContactSheet, LONGEST};
use krylux::report::html::{Block, Report};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn noise(size: Resolution, random: &mut Pcg64) -> Vec<f64> {
    (0..size.pixels()).map(|_| random.random_range(-1.0..1.0)).collect()
}

#[test]
fn each_pattern_lies_above_its_photo_and_keeps_its_pixels() -> Outcome {
    let sizes = [Resolution::new(3, 2), Resolution::new(4, 3)];
    let mut strip = ContactSheet::new(sizes, 1);
    for photo in 0..20_usize {
        // One pixel of each is lit, another one each time.
        let lit = |size: Resolution| -> Vec<f64> {
            (0..size.pixels()).map(|pixel| f64::from(u8::from(pixel == photo % size.pixels()))).collect()
        };
        strip.push(0, &lit(sizes[0]), &lit(sizes[1]), false)?;
    }
    let sheet = strip.sheet()?;
    let picture = image::load_from_memory(&sheet.png)?.into_rgb8();
    assert_eq!((picture.width() as usize, picture.height() as usize), (sheet.width, sheet.height));
    assert_eq!(sheet.frames.len(), 20);
    for (photo, frame) in sheet.frames.iter().enumerate() {
        assert_eq!((frame.number, frame.range.as_str()), (photo + 1, "1.00"));
        for ((place, alt), size) in frame.pictures.iter().zip(sizes) {
            let [left, top, width, height] = *place;
            assert_eq!((width, height), (size.width, size.height), "{alt}");
            for pixel in 0..size.pixels() {
                let (x, y) = (left + pixel % width, top + pixel / width);
                let level = picture.get_pixel(x as u32, y as u32).0;
                let expected = if pixel == photo % size.pixels() { [255; 3] } else { [0; 3] };
                assert_eq!(level, expected, "{alt}, pixel {pixel}");
            }
        }
        let [pattern, photo] = [0, 1].map(|which| frame.pictures[which].0);
        assert!(pattern[1] < photo[1] && pattern[0] == photo[0]);
    }
    Ok(())
}

#[test]
fn the_channels_of_a_colour_photo_are_one_picture() -> Outcome {
    let size = Resolution::new(2, 1);
    let mut strip = ContactSheet::new([size; 2], 3);
    for channel in 0..3 {
        let mut photo = [0.0; 2];
        photo[0] = if channel == 0 { 1.0 } else { 0.0 };
        strip.push(channel, &[1.0, 1.0], &photo, false)?;
    }
    // One more of red alone, as where the other channels' answers were found before.
    strip.push(0, &[1.0, 1.0], &[1.0, 1.0], false)?;
    assert_eq!(strip.len(), 2);
    let sheet = strip.sheet()?;
    let picture = image::load_from_memory(&sheet.png)?.into_rgb8();
    let [left, top, ..] = sheet.frames[0].pictures[1].0;
    assert_eq!(picture.get_pixel(left as u32, top as u32).0, [255, 0, 0]);
    Ok(())
}

#[test]
fn a_hundred_photos_of_128_pixels_make_a_page_of_a_few_megabytes() -> Outcome {
    let size = Resolution::new(128, 128);
    let mut random = Pcg64::seed_from_u64(1);
    let mut strip = ContactSheet::new([size; 2], 1);
    for _ in 0..100 {
        // Noise: nothing is harder to compress.
        let (pattern, photo) = (noise(size, &mut random), noise(size, &mut random));
        strip.push(0, &pattern, &photo, false)?;
    }
    let section = strip.section("W/(m² sr)", "")?.ok_or("there are photos")?;
    let page = Report { sections: vec![section], ..Report::default() }.render()?;
    println!("{} bytes", page.len());
    // 7 rows of 16 frames, each two pictures of 64² pixels, three bytes a pixel, and four letters for three bytes: 3.67 MB are the
    // most there can be, and the page around it.
    assert!(page.len() < 3_800_000, "{} bytes", page.len());
    assert_eq!(page.matches("data:image/png;base64,").count(), 1, "all on one sheet");
    Ok(())
}

#[test]
fn the_page_names_every_picture_its_number_and_its_unit() -> Outcome {
    let size = Resolution::new(4, 4);
    let mut strip = ContactSheet::new([size; 2], 1);
    for photo in 1..=12 {
        strip.push(0, &[1.0; 16], &[f64::from(photo) / 100.0; 16], false)?;
    }
    let section = strip.section("DN/s", "White comes first.")?.ok_or("there are photos")?;
    assert!(section.text.starts_with("All 12 photos") && section.text.contains("DN/s"), "{}", section.text);
    assert!(section.text.ends_with("White comes first."));
    assert!(
        matches!(section.blocks.as_slice(), [Block::ContactSheet { sheet, .. }] if sheet.frames.len() == 12)
    );
    let page = Report { sections: vec![section], ..Report::default() }.render()?;
    // An even photo is shown at half of white.
    for expected in ["aria-label=\"pattern 12\"", "aria-label=\"photo 12\"", "<b>12</b> 0.240"] {
        assert!(page.contains(expected), "{expected}");
    }
    assert_eq!(page.matches("href=\"#sheet-").count(), 24);
    assert!(page.contains("id=\"sheet-1-1\""));
    assert!(!page.contains("http"), "nothing is fetched");
    assert!(ContactSheet::new([size; 2], 1).section("DN/s", "")?.is_none(), "no photo, no strip");
    Ok(())
}

#[test]
fn long_runs_show_their_first_photos_and_say_so() -> Outcome {
    let size = Resolution::new(2, 2);
    let mut strip = ContactSheet::new([size; 2], 1);
    for _ in 0..LONGEST + 5 {
        strip.push(0, &[1.0; 4], &[1.0; 4], false)?;
    }
    let section = strip.section("DN/s", "")?.ok_or("there are photos")?;
    assert!(section.text.starts_with(&format!("The first {LONGEST} of {} photos", LONGEST + 5)));
    assert_eq!(strip.sheet()?.frames.len(), LONGEST);
    assert!(strip.push(0, &[1.0; 3], &[1.0; 4], false).is_ok(), "what is not kept is not looked at");
    assert!(ContactSheet::new([size; 2], 1).push(0, &[1.0; 3], &[1.0; 4], false).is_err());
    Ok(())
}
