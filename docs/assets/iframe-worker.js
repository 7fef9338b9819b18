// Browsers start no worker from file://. There, search runs in a hidden frame that looks like a worker to its page.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.appendChild(frame);
      const inside = frame.contentWindow;
      const waiting = [];
      const send = (data) => inside.dispatchEvent(new MessageEvent("message", { data }));
      inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      const script = inside.document.createElement("script");
      script.src = url;
      script.onload = () => { this.postMessage = send; waiting.forEach(send); };
      this.postMessage = (data) => waiting.push(data);
      this.terminate = () => frame.remove();
      inside.document.body.appendChild(script);
    }
  };
}
