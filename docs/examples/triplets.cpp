// Receives triplets from Svev, live or replayed, and prints the mean grey value of each camera's frame.
//
//   apt install g++ libzmq3-dev nlohmann-json3-dev
//   g++ -std=c++17 -O2 triplets.cpp -o triplets -lzmq
//   ./triplets tcp://127.0.0.1:5556        until nothing has come for 10 s
#include <nlohmann/json.hpp>
#include <zmq.h>

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr int kPatienceMs = 10'000;

// The parts of the next message; none when nothing has come in time. A message comes whole or not at all.
std::vector<std::string> receive(void *socket) {
  std::vector<std::string> parts;
  int more = 1;
  while (more) {
    zmq_msg_t part;
    zmq_msg_init(&part);
    if (zmq_msg_recv(&part, socket, 0) < 0) {
      zmq_msg_close(&part);
      if (zmq_errno() == EAGAIN) return {};
      throw std::runtime_error(zmq_strerror(zmq_errno()));
    }
    parts.emplace_back(static_cast<const char *>(zmq_msg_data(&part)), zmq_msg_size(&part));
    more = zmq_msg_more(&part);
    zmq_msg_close(&part);
  }
  return parts;
}

// Mean of the columns first to last - 1 in the upper rows of a triplet; two bytes a pixel have the lower one first.
double mean(const std::string &pixels, std::size_t width, std::size_t rows, std::size_t first, std::size_t last,
            std::size_t bytes) {
  const auto *data = reinterpret_cast<const std::uint8_t *>(pixels.data());
  double sum = 0;
  for (std::size_t row = 0; row < rows; ++row)
    for (std::size_t column = first; column < last; ++column) {
      const auto *pixel = data + (row * width + column) * bytes;
      sum += bytes == 1 ? pixel[0] : pixel[0] | pixel[1] << 8;
    }
  return sum / static_cast<double>(rows * (last - first));
}

void show(const nlohmann::json &tag, const std::string &pixels) {
  std::printf("pulse %lld:", tag.at("pulse").get<long long>());
  const std::size_t rows = tag.at("shape")[0], width = tag.at("shape")[1];
  const std::size_t bytes = tag.at("dtype") == "uint16" ? 2 : 1;
  const bool whole = pixels.size() == rows * width * bytes;  // empty if no camera delivered a frame
  for (const auto &camera : tag.at("cameras")) {
    const std::string name = camera.at("name"), status = camera.at("status");
    if (status == "ok" && whole)
      std::printf(" %s %.2f", name.c_str(), mean(pixels, width, camera.value("rows", rows), camera["columns"][0],
                                                 camera["columns"][1], bytes));
    else
      std::printf(" %s %s", name.c_str(), status.c_str());
  }
  std::printf("\n");
}

}  // namespace

int main(int count, char **words) {
  const char *address = count > 1 ? words[1] : "tcp://127.0.0.1:5556";
  void *context = zmq_ctx_new();
  void *socket = zmq_socket(context, ZMQ_SUB);
  zmq_setsockopt(socket, ZMQ_SUBSCRIBE, "triplet", std::strlen("triplet"));
  zmq_setsockopt(socket, ZMQ_RCVTIMEO, &kPatienceMs, sizeof kPatienceMs);
  if (zmq_connect(socket, address) != 0) {
    std::fprintf(stderr, "%s: %s\n", address, zmq_strerror(zmq_errno()));
    return 2;
  }
  long long last = 0;
  std::string recording;
  for (auto parts = receive(socket); !parts.empty(); parts = receive(socket)) {
    if (parts.size() != 3) continue;
    const auto tag = nlohmann::json::parse(parts[1]);
    const long long pulse = tag.at("pulse");
    if (tag.at("recording") == recording && pulse != last + 1)
      std::printf("missed %lld pulses: this program is too slow\n", pulse - last - 1);
    last = pulse;
    recording = tag.at("recording");
    show(tag, parts[2]);
  }
  zmq_close(socket);
  zmq_ctx_destroy(context);
}
