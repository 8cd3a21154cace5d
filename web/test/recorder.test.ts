import assert from "node:assert/strict";
import { test } from "node:test";
import { circle } from "../src/pen.ts";
import { SvgPen } from "../src/recorder.ts";

function drawn(draw: (pen: SvgPen) => void): string {
  const pen = new SvgPen(100, 50, (raster) => `data:test,${raster.width}x${raster.height}`);
  draw(pen);
  return pen.toString();
}

test("lines, with colour, width and dashes", () => {
  const svg = drawn((pen) => {
    pen.strokeStyle = "#123456";
    pen.lineWidth = 2.5;
    pen.setLineDash([4, 2]);
    pen.beginPath();
    pen.moveTo(1, 2);
    pen.lineTo(3.14159, 4);
    pen.stroke();
  });
  assert.ok(
    svg.includes('<path d="M1 2L3.14 4" fill="none" stroke="#123456" stroke-width="2.5" stroke-dasharray="4 2"/>'),
    svg,
  );
});

test("a circle closes", () => {
  const svg = drawn((pen) => {
    circle(pen, 10, 10, 5);
    pen.fill();
  });
  assert.ok(svg.includes('d="M15 10A5 5 0 0 1 5 10A5 5 0 0 1 15 10Z"'), svg);
});

test("what is saved comes back, and groups of clips close with it", () => {
  const svg = drawn((pen) => {
    pen.fillStyle = "red";
    pen.save();
    pen.fillStyle = "blue";
    pen.beginPath();
    pen.rect(0, 0, 10, 10);
    pen.clip();
    pen.restore();
    pen.fillRect(1, 1, 2, 2);
  });
  assert.ok(svg.includes("</g>\n<rect") && svg.includes('fill="red"'));
  const [, id] = /<clipPath id="(\w+)"><path d="M0 0h10v10h-10Z"\/><\/clipPath>/.exec(svg) ?? [];
  assert.ok(id && svg.includes(`clip-path="url(#${id})"`), svg);
});

test("texts are escaped and anchored", () => {
  const svg = drawn((pen) => {
    pen.font = "italic 15px Georgia, 'Noto Serif'";
    pen.textAlign = "right";
    pen.fillText("a < b & c", 5, 6);
  });
  assert.ok(
    svg.includes("a &lt; b &amp; c") && svg.includes('text-anchor="end"') && svg.includes('font-style="italic"'),
    svg,
  );
});

test("a raster is embedded", () => {
  const svg = drawn((pen) => pen.raster({ width: 3, height: 2, pixels: new Uint8ClampedArray(24) }, 1, 2, 30, 20));
  assert.ok(svg.includes('href="data:test,3x2"'));
});

test("files that stand in one page do not take each other's clips", () => {
  const clipped = (size: number) =>
    drawn((pen) => {
      pen.beginPath();
      pen.rect(0, 0, size, size);
      pen.clip();
    });
  const id = (svg: string) => /clipPath id="(\w+)"/.exec(svg)?.[1];
  assert.notEqual(id(clipped(10)), id(clipped(11)));
  assert.equal(id(clipped(10)), id(clipped(10)));
});
