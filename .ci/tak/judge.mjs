// Reads events (a JSON list of XML texts), and tells what a TAK client makes of each, or why it refuses it.
import CoT from "@tak-ps/node-cot";
import { readFileSync } from "node:fs";

const told = JSON.parse(readFileSync(0, "utf8")).map((xml) => {
  try {
    const { id, properties, geometry } = new CoT(xml).to_geojson();
    return { id, geometry, ...properties };
  } catch (error) {
    return { refused: error.message };
  }
});
process.stdout.write(JSON.stringify(told));
