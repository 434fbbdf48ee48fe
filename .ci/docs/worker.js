// Browsers refuse workers in a page that is opened from the disk (file:). The search of the theme needs one: this runs it in a
// hidden frame of the page. The theme asks for this name, and then takes `importScripts` for asynchronous.
if (location.protocol === "file:") {
  window.IFrameWorker = class extends EventTarget {
    constructor(url) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.ready = new Promise((resolve) => {
        window.addEventListener("message", (event) => {
          if (event.source !== this.frame.contentWindow) return;
          if (event.data === "worker ready") resolve();
          else this.dispatchEvent(new MessageEvent("message", { data: event.data }));
        });
      });
      document.body.append(this.frame);
      this.frame.srcdoc = `<script>
        postMessage = (data) => parent.postMessage(data, "*");
        importScripts = (...urls) => Promise.all(urls.map((url) => new Promise((resolve, reject) => {
          const script = Object.assign(document.createElement("script"), { src: url, async: false, onload: resolve, onerror: reject });
          document.head.append(script);
        })));
      <\/script><script src="${url}"><\/script><script>postMessage("worker ready")<\/script>`;
    }
    postMessage(data) {
      this.ready.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data })));
    }
    terminate() {
      this.frame.remove();
    }
  };
  window.Worker = window.IFrameWorker;
}
