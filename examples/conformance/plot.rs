//! Line plots, on linear or logarithmic axes, as small PNG files.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use std::ops::Range;
use std::path::Path;

use plotters::prelude::*;
use plotters::style::register_font;

const SIZE: (u32, u32) = (890, 480);

/// The width of the margin with the names of the lines.
const LEGEND: u32 = 205;

/// Distinguishable with most kinds of colour blindness, too (Okabe and Ito, 2008).
const COLOURS: [RGBColor; 10] = [
    RGBColor(230, 159, 0),
    RGBColor(0, 114, 178),
    RGBColor(86, 180, 233),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(213, 94, 0),
    RGBColor(0, 0, 0),
    RGBColor(150, 150, 0),
    RGBColor(150, 150, 150),
    RGBColor(148, 103, 189),
];

/// One axis.
pub struct Axis {
    pub label: &'static str,
    pub logarithmic: bool,
    /// What is outside is cut off.
    pub range: Range<f64>,
}

impl Axis {
    /// The values shown, and where they stand on the paper.
    fn place(&self, value: f64) -> f64 {
        if self.logarithmic { value.log10() } else { value }
    }

    fn paper(&self) -> Range<f64> {
        self.place(self.range.start)..self.place(self.range.end)
    }

    fn tick(&self, place: &f64) -> String {
        if !self.logarithmic {
            let value = if place.abs() < 1e-9 { 0.0 } else { *place };
            return format!("{value:.6}").trim_end_matches('0').trim_end_matches('.').to_owned();
        }
        match place.round() {
            // Between powers of ten.
            power if (place - power).abs() > 1e-6 => String::new(),
            power if (-3.0..=4.0).contains(&power) => 10_f64.powf(power).to_string(),
            power => format!("1e{power}"),
        }
    }
}

/// A line with a name.
pub struct Line {
    pub name: String,
    pub points: Vec<(f64, f64)>,
}

/// A picture.
pub struct Plot {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub lines: Vec<Line>,
}

impl Plot {
    /// Draws it into a file.
    pub fn write(&self, file: &Path) -> Result<(), Box<dyn Error>> {
        // Registering it again has no effect.
        if register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT).is_err() {
            return Err("the font of the plots cannot be read".into());
        }
        let mut pixels = vec![255; (SIZE.0 * SIZE.1 * 3) as usize];
        self.draw(&mut pixels)?;
        let mut encoder = png::Encoder::new(BufWriter::new(File::create(file)?), SIZE.0, SIZE.1);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_compression(png::Compression::High);
        encoder.write_header()?.write_image_data(&pixels)?;
        Ok(())
    }

    fn draw(&self, pixels: &mut [u8]) -> Result<(), Box<dyn Error>> {
        let area = BitMapBackend::with_buffer(pixels, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        let (paper, margin) = area.split_horizontally(SIZE.0 - LEGEND);
        let mut chart = ChartBuilder::on(&paper)
            .caption(&self.title, ("sans-serif", 19))
            .margin(10)
            .x_label_area_size(38)
            .y_label_area_size(62)
            .build_cartesian_2d(self.x.paper(), self.y.paper())?;
        chart
            .configure_mesh()
            .max_light_lines(1)
            .bold_line_style(RGBColor(215, 215, 215))
            .x_desc(self.x.label)
            .y_desc(self.y.label)
            .label_style(("sans-serif", 15))
            .x_label_formatter(&|place| self.x.tick(place))
            .y_label_formatter(&|place| self.y.tick(place))
            .draw()?;
        for (number, (line, colour)) in self.lines.iter().zip(COLOURS.iter().cycle()).enumerate() {
            let points: Vec<(f64, f64)> = self.visible(line);
            let style = colour.stroke_width(2);
            chart.draw_series(LineSeries::new(points.iter().copied(), style))?;
            if points.len() < 30 {
                chart.draw_series(points.iter().map(|point| Circle::new(*point, 3, colour.filled())))?;
            }
            let height = 50 + 24 * number as i32;
            margin.draw(&PathElement::new([(0, height), (20, height)], style))?;
            margin.draw(&Text::new(line.name.as_str(), (28, height - 8), ("sans-serif", 16)))?;
        }
        area.present()?;
        Ok(())
    }

    /// The points of a line up to where it leaves the picture.
    fn visible(&self, line: &Line) -> Vec<(f64, f64)> {
        let inside = |(x, y): &(f64, f64)| self.x.range.contains(x) && self.y.range.contains(y);
        line.points
            .iter()
            .filter(|point| inside(point))
            .map(|(x, y)| (self.x.place(*x), self.y.place(*y)))
            .collect()
    }
}
