// Before the charts' library reads it: canvases of at least two pixels to one, because a browser that prints enlarges them.
"use strict";
{
  const native = Object.getOwnPropertyDescriptor(window, "devicePixelRatio").get;
  Object.defineProperty(window, "devicePixelRatio", { get: () => Math.max(2, native.call(window)), configurable: true });
}
