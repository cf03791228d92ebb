// The hand on the view of the robot: a pointer turns it, a wheel with a modifier key and keys move it.
"use strict";

biflag.takeHand = (scene) => {
  const { canvas } = scene;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    canvas.classList.add("held");
  });
  canvas.addEventListener("pointermove", (event) => {
    if (canvas.hasPointerCapture(event.pointerId)) scene.turn(-event.movementX * 0.01, event.movementY * 0.01);
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => canvas.classList.remove("held"));
  canvas.addEventListener("wheel", (event) => {
    // Without a modifier key, the wheel scrolls the page.
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    scene.zoom(Math.exp(-event.deltaY * 0.002));
  }, { passive: false });
  canvas.addEventListener("dblclick", () => scene.look("perspective"));
  const keys = {
    ArrowLeft: () => scene.turn(0.1, 0),
    ArrowRight: () => scene.turn(-0.1, 0),
    ArrowUp: () => scene.turn(0, 0.1),
    ArrowDown: () => scene.turn(0, -0.1),
    "+": () => scene.zoom(1.2),
    "=": () => scene.zoom(1.2),
    "-": () => scene.zoom(1 / 1.2),
    Home: () => scene.look("perspective"),
    " ": () => scene.trial.toggle(),
  };
  canvas.addEventListener("keydown", (event) => {
    const act = keys[event.key];
    if (!act || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    act();
  });
};
