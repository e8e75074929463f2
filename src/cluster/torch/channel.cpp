// The channel of LibTorch's c10d: a TCPStore, sums by Gloo, and sums on GPUs by NCCL where LibTorch has it. On its own:
// few programs are started by a launcher, and LibTorch takes long to load.

#ifndef USE_C10D_GLOO
#define USE_C10D_GLOO  // LibTorch has it; only its headers ask
#endif

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <sys/socket.h>
#include <torch/version.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <torch/csrc/distributed/c10d/PrefixStore.hpp>
#include <torch/csrc/distributed/c10d/ProcessGroupGloo.hpp>
#include <torch/csrc/distributed/c10d/TCPStore.hpp>

#if CNERF_NCCL
#include <c10/cuda/CUDAGuard.h>
#include <c10/cuda/CUDAStream.h>

#include <torch/csrc/distributed/c10d/ProcessGroupNCCL.hpp>
#endif

#include "src/base/file_descriptor.h"
#include "src/cluster/channel.h"

namespace cnerf::cluster {
namespace {

using Milliseconds = std::chrono::milliseconds;

/// For ranks that are late at an operation: rank 0 may save, or draw for a page. Who is lost is found by the Watch.
constexpr std::chrono::minutes kLongestOperation{30};

/// LibTorch from 2.4 on asks for libuv, which Debian builds it without.
template <typename Options>
void do_without_libuv(Options& options) {
  if constexpr (requires { options.useLibUV; }) options.useLibUV = false;
}

/// @param topic  of what is told through it; others have names of their own
c10::intrusive_ptr<c10d::Store> connected(const Launch& launch, bool opens, Seconds limit,
                                          const std::string& topic = "") {
  c10d::TCPStoreOptions options;
  options.port = std::uint16_t(launch.port);
  options.isServer = opens && launch.rank == 0 && !launch.has_store;
  options.waitWorkers = false;
  do_without_libuv(options);
  options.timeout = std::chrono::duration_cast<Milliseconds>(limit);
  auto store = c10::make_intrusive<c10d::TCPStore>(launch.host, options);
  return c10::make_intrusive<c10d::PrefixStore>("cnerf/" + topic + launch.attempt, store);
}

class C10dStore final : public Store {
 public:
  explicit C10dStore(c10::intrusive_ptr<c10d::Store> store) : store_(std::move(store)) {}
  void set(const std::string& key, const Bytes& value) override {
    const auto* begin = reinterpret_cast<const std::uint8_t*>(value.data());
    store_->set(key, std::vector<std::uint8_t>(begin, begin + value.size()));
  }
  std::optional<Bytes> get(const std::string& key) override {
    if (!store_->check({key})) return std::nullopt;
    const std::vector<std::uint8_t> value = store_->get(key);
    const auto* begin = reinterpret_cast<const std::byte*>(value.data());
    return Bytes(begin, begin + value.size());
  }
  std::int64_t add(const std::string& key, std::int64_t amount) override { return store_->add(key, amount); }
  void remove(const std::string& key) override { store_->deleteKey(key); }

 private:
  c10::intrusive_ptr<c10d::Store> store_;
};

/// The address of this machine that packets to `host` come from: a machine may have several, and its name may stand for
/// one that others cannot reach.
std::string address_towards(const std::string& host) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(host.c_str(), "9", &hints, &found) != 0) throw std::runtime_error("unknown host " + host);
  const FileDescriptor socket(::socket(found->ai_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_storage own{};
  ::socklen_t size = sizeof own;
  // Nothing is sent: a datagram socket only looks the way up.
  const bool is_reached = ::connect(socket.number(), found->ai_addr, found->ai_addrlen) == 0 &&
                          ::getsockname(socket.number(), reinterpret_cast<sockaddr*>(&own), &size) == 0;
  ::freeaddrinfo(found);
  char text[NI_MAXHOST] = "";
  if (!is_reached ||
      ::getnameinfo(reinterpret_cast<sockaddr*>(&own), size, text, sizeof text, nullptr, 0, NI_NUMERICHOST) != 0) {
    throw std::runtime_error("no way to " + host + ": " + std::strerror(errno));
  }
  return text;
}

/// An address of this machine at one of its networks; empty where it is at none.
std::string network_address() {
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return "";
  char text[INET_ADDRSTRLEN] = "";
  for (const ifaddrs* one = all; one != nullptr && *text == 0; one = one->ifa_next) {
    const bool is_of_network = (one->ifa_flags & (IFF_UP | IFF_LOOPBACK)) == IFF_UP;
    if (!is_of_network || one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr, text, sizeof text);
  }
  ::freeifaddrs(all);
  return text;
}

/// What other ranks reach this one at. Debian has a machine call itself 127.0.1.1, which others cannot use.
std::shared_ptr<::gloo::transport::Device> device_of(const Launch& launch) {
  if (const char* const name = std::getenv("GLOO_SOCKET_IFNAME"); name != nullptr && *name != 0) {
    return c10d::ProcessGroupGloo::createDeviceForInterface(std::string(name).substr(0, std::strcspn(name, ",")));
  }
  std::string address = address_towards(launch.host);
  if (launch.local_size < launch.size && address.starts_with("127.")) {
    if (std::string outside = network_address(); !outside.empty()) address = std::move(outside);
  }
  return c10d::ProcessGroupGloo::createDeviceForHostname(address);
}

class GlooGroup final : public Group {
 public:
  GlooGroup(const Launch& launch, Seconds limit) {
    // Gloo writes to peers that may have died. That has to be an error of the operation, and not the process's end.
    ::signal(SIGPIPE, SIG_IGN);
    const auto options = c10d::ProcessGroupGloo::Options::create(kLongestOperation);
    options->devices.push_back(device_of(launch));
    options->threads = 2;
    group_ =
        c10::make_intrusive<c10d::ProcessGroupGloo>(connected(launch, false, limit), launch.rank, launch.size, options);
  }
  void sum(std::span<float> values) override { sum_of(values.data(), values.size(), at::kFloat); }
  void sum(std::span<double> values) override { sum_of(values.data(), values.size(), at::kDouble); }
  void broadcast(std::span<std::byte> bytes, int from) override {
    std::vector<at::Tensor> tensors = {at::from_blob(bytes.data(), {std::int64_t(bytes.size())}, at::kByte)};
    c10d::BroadcastOptions options;
    options.rootRank = from;
    group_->broadcast(tensors, options)->wait();
  }

 private:
  void sum_of(void* values, std::size_t count, at::ScalarType type) {
    if (count == 0) return;
    std::vector<at::Tensor> tensors = {at::from_blob(values, {std::int64_t(count)}, type)};
    group_->allreduce(tensors)->wait();
  }

  c10::intrusive_ptr<c10d::ProcessGroupGloo> group_;
};

#if CNERF_NCCL
/// NCCL has streams of its own, which wait for the caller's and which the caller's waits for.
class NcclSums final : public DeviceSums {
 public:
  NcclSums(const Launch& launch, Seconds limit) {
    // More blocks than NCCL takes by itself: much of a step waits for what is exchanged.
    for (const char* variable : {"NCCL_MIN_CTAS", "NCCL_MAX_CTAS"}) ::setenv(variable, "32", /*overwrite=*/0);
    // Kernels of a sum find room beside those that fill the GPU.
    const auto options = c10d::ProcessGroupNCCL::Options::create(/*is_high_priority_stream=*/true);
    options->timeout = kLongestOperation;
    const c10::intrusive_ptr<c10d::Store> store = connected(launch, false, limit, "nccl/");
    store->setTimeout(std::chrono::duration_cast<Milliseconds>(kLongestOperation));  // the first sum waits in it
    group_ = c10::make_intrusive<c10d::ProcessGroupNCCL>(store, launch.rank, launch.size, options);
  }
  void sum(std::span<float> values, void* stream) override { sum_of(values.data(), values.size(), at::kFloat, stream); }
  void sum(std::span<double> values, void* stream) override {
    sum_of(values.data(), values.size(), at::kDouble, stream);
  }
  void sum_own_piece(std::span<Bfloat16> values, void* stream) override {
    const c10::cuda::CUDAStreamGuard guard = on(stream);
    at::Tensor all = tensor_of(values.data(), values.size(), at::kBFloat16), own = own_piece_of(all);
    group_->_reduce_scatter_base(own, all)->wait();
  }
  void hand_round(std::span<std::byte> values, void* stream) override {
    const c10::cuda::CUDAStreamGuard guard = on(stream);
    at::Tensor all = tensor_of(values.data(), values.size(), at::kByte), own = own_piece_of(all);
    group_->_allgather_base(all, own)->wait();
  }

 private:
  void sum_of(void* values, std::size_t count, at::ScalarType type, void* stream) {
    const c10::cuda::CUDAStreamGuard guard = on(stream);
    std::vector<at::Tensor> tensors = {tensor_of(values, count, type)};
    group_->allreduce(tensors)->wait();  // the stream waits, not the caller
  }
  static c10::Device own_device() { return {c10::kCUDA, 0}; }  // the process sees one GPU, or takes the first one
  static c10::cuda::CUDAStreamGuard on(void* stream) {
    return c10::cuda::CUDAStreamGuard(
        c10::cuda::getStreamFromExternal(static_cast<cudaStream_t>(stream), own_device().index()));
  }
  static at::Tensor tensor_of(void* values, std::size_t count, at::ScalarType type) {
    return at::from_blob(values, {std::int64_t(count)}, at::TensorOptions().dtype(type).device(own_device()));
  }
  [[nodiscard]] at::Tensor own_piece_of(const at::Tensor& all) const {
    const std::int64_t size = all.numel() / group_->getSize();
    return all.narrow(0, group_->getRank() * size, size);
  }

  c10::intrusive_ptr<c10d::ProcessGroupNCCL> group_;
};
#endif

}  // namespace
}  // namespace cnerf::cluster

extern "C" __attribute__((visibility("default"))) const cnerf::cluster::Channel* cnerf_cluster_channel() {
  using namespace cnerf::cluster;
  static const Channel channel {
    [](const Launch& launch, bool opens, Seconds limit) -> std::unique_ptr<Store> {
      return std::make_unique<C10dStore>(connected(launch, opens, limit));
    },
        [](const Launch& launch, Seconds limit) -> std::unique_ptr<Group> {
          return std::make_unique<GlooGroup>(launch, limit);
        },
#if CNERF_NCCL
        "LibTorch " TORCH_VERSION ": Gloo, NCCL",
        [](const Launch& launch, Seconds limit) -> std::unique_ptr<cnerf::DeviceSums> {
          return std::make_unique<NcclSums>(launch, limit);
        }
  };
#else
        "LibTorch " TORCH_VERSION ": Gloo"
  };
#endif
  return &channel;
}
