"use strict";
// Conversion of an SVG to a PNG that contains its resolution, so that it has the intended width on paper.
{
  const METRES_PER_INCH = 0.0254, SIGNATURE_AND_HEADER = 33;

  const checksum = (bytes) => {
    let sum = 0xffffffff;
    for (const byte of bytes) {
      sum ^= byte;
      for (let k = 0; k < 8; k++) sum = (sum >>> 1) ^ (sum & 1 ? 0xedb88320 : 0);
    }
    return (sum ^ 0xffffffff) >>> 0;
  };

  // Return the PNG chunk pHYs: dots per metre in both directions.
  const resolution = (dotsPerInch) => {
    const bytes = new Uint8Array(21), view = new DataView(bytes.buffer), dots = Math.round(dotsPerInch / METRES_PER_INCH);
    view.setUint32(0, 9);
    bytes.set([..."pHYs"].map((letter) => letter.charCodeAt(0)), 4);
    view.setUint32(8, dots);
    view.setUint32(12, dots);
    bytes[16] = 1;
    view.setUint32(17, checksum(bytes.subarray(4, 17)));
    return bytes;
  };

  // Return an SVG (blob) as PNG; width, height [mm].
  report.rasterise = async (drawing, width, height, dotsPerInch) => {
    const image = new Image(), address = URL.createObjectURL(drawing), scale = dotsPerInch / 25.4;
    image.src = address;
    await image.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width: Math.round(width * scale), height: Math.round(height * scale) });
    canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
    URL.revokeObjectURL(address);
    const bytes = new Uint8Array(await (await new Promise((done) => canvas.toBlob(done, "image/png"))).arrayBuffer());
    return new Blob([bytes.subarray(0, SIGNATURE_AND_HEADER), resolution(dotsPerInch), bytes.subarray(SIGNATURE_AND_HEADER)], { type: "image/png" });
  };
}
