// The WebSocket to the viewer process: comes back by itself.

const FIRST_RETRY = 400;
const LONGEST_RETRY = 5000;

export class Socket {
  constructor(onMessage, onState) {
    this.onMessage = onMessage;
    this.onState = onState;
    this.wait = FIRST_RETRY;
    this.bytes = 0;
    this.connect();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    this.socket = new WebSocket(`${scheme}//${location.host}/socket${location.search}`);
    this.socket.onopen = () => {
      this.wait = FIRST_RETRY;
      this.onState(true);
    };
    this.socket.onmessage = ({ data }) => {
      this.bytes += data.length;
      this.onMessage(JSON.parse(data));
    };
    this.socket.onclose = () => {
      this.onState(false);
      setTimeout(() => this.connect(), this.wait);
      this.wait = Math.min(LONGEST_RETRY, this.wait * 2);
    };
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
