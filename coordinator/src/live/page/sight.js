// Projects points into the picture and moves the camera. Pure functions, without page or state. `camera` is that of a
// scene message. A place in the picture is [x, y] from the upper left corner, 0 to 1.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => times(a, 1 / (length(a) || 1));

const degrees = (angle) => angle * Math.PI / 180;

// The camera's axes: `right` is the picture's, so it points to the world's left in a mirrored picture.
export function axes(camera) {
  const forward = unit(subtract(camera.target, camera.origin));
  const right = unit(cross(forward, camera.up));
  return { forward, right: camera.flip_x ? times(right, -1) : right, up: cross(right, forward) };
}

const halves = (camera) => [camera.tan_x, camera.tan_x * camera.height / camera.width];

// Place of a point and its distance along the axis; null behind the camera.
export function project(camera, view, point) {
  const away = subtract(point, camera.origin);
  const depth = dot(away, view.forward);
  if (!(depth > 1e-9)) return null;
  const [half_x, half_y] = halves(camera);
  const x = (dot(away, view.right) / depth - camera.shift[0]) / half_x;
  const y = (dot(away, view.up) / depth - camera.shift[1]) / half_y;
  return { x: 0.5 + 0.5 * x, y: 0.5 - 0.5 * y, depth };
}

// The ray from the camera through a place, with length one along the axis.
export function through(camera, view, [x, y]) {
  const [half_x, half_y] = halves(camera);
  const sideways = times(view.right, (2 * x - 1) * half_x + camera.shift[0]);
  return add(view.forward, add(sideways, times(view.up, (1 - 2 * y) * half_y + camera.shift[1])));
}

// Where a ray meets the plane through a point; null if it does not, or only near the horizon.
export function onPlane(camera, way, point, normal) {
  const slope = dot(way, normal) / length(way);
  if (Math.abs(slope) < 0.02) return null;
  const distance = dot(subtract(point, camera.origin), normal) / dot(way, normal);
  return distance > 0 ? add(camera.origin, times(way, distance)) : null;
}

// Where along an axis through a point a ray comes nearest; null if they are nearly parallel.
export function alongAxis(camera, way, point, axis) {
  const [w, away] = [unit(way), subtract(point, camera.origin)];
  const cosine = dot(w, axis);
  const sine_square = 1 - cosine * cosine;
  return sine_square < 1e-3 ? null : (cosine * dot(w, away) - dot(axis, away)) / sine_square;
}

// One turn equal to `over` degrees about one axis followed by `around` about another, by the right-hand rule.
export function turnOf([first, over], [second, around]) {
  const [a, b] = [0.5 * degrees(over), 0.5 * degrees(around)];
  const [u, v] = [times(unit(first), Math.sin(a)), times(unit(second), Math.sin(b))];
  const cosine = Math.cos(a) * Math.cos(b) - dot(u, v);
  const axis = add(add(times(u, Math.cos(b)), times(v, Math.cos(a))), cross(v, u));
  const angle = 2 * Math.atan2(length(axis), cosine) * 180 / Math.PI;
  return length(axis) > 0 ? { axis: unit(axis), angle } : { axis: unit(second), angle: 0 };
}

// Where the line from the picture's centre to a point leaves the picture: [x, y], and its bearing on the screen in
// degrees, clockwise from the right. `margin`: distance from the edges as fractions of width and height. A point behind
// the camera is shown on its side.
export function edge(camera, view, point, margin, aspect) {
  const seen = project(camera, view, point);
  const away = subtract(point, camera.origin);
  let [x, y] = seen !== null ? [seen.x - 0.5, seen.y - 0.5] : [dot(away, view.right), -dot(away, view.up) * aspect];
  // A point directly behind is shown at the bottom.
  if (!(Math.hypot(x, y) > 1e-9 * (1 + length(away)))) [x, y] = [0, 1];
  const scale = Math.min((0.5 - margin[0]) / Math.abs(x), (0.5 - margin[1]) / Math.abs(y));
  return { at: [0.5 + scale * x, 0.5 + scale * y], bearing: Math.atan2(y, x * aspect) * 180 / Math.PI };
}

// By the right-hand rule.
function turn(v, axis, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return add(add(times(v, c), times(cross(axis, v), s)), times(axis, dot(axis, v) * (1 - c)));
}

// Turntable motion around the target, by angles in degrees; never over the poles.
export function orbit(camera, around, over) {
  const up = unit(camera.up);
  const offset = subtract(camera.origin, camera.target);
  const distance = length(offset);
  const height = Math.asin(Math.min(1, Math.max(-1, dot(offset, up) / distance)));
  const level = unit(subtract(offset, times(up, dot(offset, up))));
  const steepest = degrees(89.5);
  const risen = Math.min(steepest, Math.max(-steepest, height + degrees(over)));
  const flat = turn(level, up, degrees(camera.flip_x ? -around : around));
  const to = add(times(flat, Math.cos(risen)), times(up, Math.sin(risen)));
  return { ...camera, origin: add(camera.target, times(to, distance)) };
}

// Sideways, so that what is at the target's distance moves by these fractions of the picture's width and height.
export function pan(camera, x, y) {
  const view = axes(camera);
  const [half_x, half_y] = halves(camera);
  const distance = length(subtract(camera.target, camera.origin));
  const by = times(add(times(view.right, -2 * x * half_x), times(view.up, 2 * y * half_y)), distance);
  return { ...camera, origin: add(camera.origin, by), target: add(camera.target, by) };
}

// Multiply the distance to the target.
export function dolly(camera, factor) {
  const offset = subtract(camera.origin, camera.target);
  const nearest = 1e-4 / length(offset);
  return { ...camera, origin: add(camera.target, times(offset, Math.max(factor, nearest))) };
}

// Multiply the width of the view.
export function widen(camera, factor) {
  const half = (fov) => Math.tan(degrees(0.5 * fov));
  const wanted = half(camera.fov) * factor;
  const bounded = Math.min(half(170), Math.max(half(0.5), wanted));
  const by = bounded / half(camera.fov);
  return {
    ...camera, fov: 2 * Math.atan(bounded) * 180 / Math.PI, tan_x: camera.tan_x * by,
    shift: [camera.shift[0] * by, camera.shift[1] * by],
  };
}
