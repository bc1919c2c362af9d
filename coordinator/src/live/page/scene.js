// Validates scene messages: everything the page relies on exists and has the right type.

const isPoint = (value) => Array.isArray(value) && value.length === 3 && value.every(Number.isFinite);
const isNothing = (value) => value === null || value === undefined;
const isText = (value) => typeof value === "string";
const isCount = (value) => Number.isSafeInteger(value) && value >= 0;

function expect(is, what) {
  if (!is) throw new Error(`a scene with a wrong ${what}`);
}

// Fills in what may be omitted.
export function checkScene(scene) {
  expect(isCount(scene.seq) && isCount(scene.revision), "number");
  scene.title = String(scene.title ?? "");
  scene.file = String(scene.file ?? "");

  const { camera } = scene;
  expect(camera && isPoint(camera.origin) && isPoint(camera.target), "camera");
  camera.up = isPoint(camera.up) ? camera.up : [0, 1, 0];
  camera.shift = Array.isArray(camera.shift) && camera.shift.length === 2 ? camera.shift : [0, 0];
  const sides = [camera.tan_x, camera.width, camera.height, camera.fov];
  expect(sides.every((side) => Number.isFinite(side) && side > 0), "field of view");

  expect(Array.isArray(scene.things) && Array.isArray(scene.fields), "list");
  for (const thing of scene.things) {
    expect(isText(thing?.id) && isText(thing.kind), "thing");
    thing.name = isText(thing.name) && thing.name !== "" ? thing.name : thing.id;
    thing.at = isPoint(thing.at) ? thing.at : null;
    thing.target = isPoint(thing.target) ? thing.target : null;
    thing.emits = Boolean(thing.emits);
    thing.radius = Number.isFinite(thing.radius) ? thing.radius : 0;
  }
  for (const field of scene.fields) {
    expect(isText(field?.path) && isText(field.name) && isText(field.kind), "field");
    field.group = String(field.group ?? "");
    field.group_kind = String(field.group_kind ?? "");
    for (const name of ["thing", "value", "default", "min", "max"]) {
      if (isNothing(field[name])) field[name] = null;
    }
    field.given = Boolean(field.given);
  }
}
