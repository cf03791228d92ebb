// Runs before the library of the charts: canvases have at least two pixels per CSS pixel, because printing enlarges them.
"use strict";
{
  const native = Object.getOwnPropertyDescriptor(window, "devicePixelRatio").get;
  Object.defineProperty(window, "devicePixelRatio", { get: () => Math.max(2, native.call(window)), configurable: true });
}
