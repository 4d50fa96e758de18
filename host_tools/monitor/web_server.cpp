#include "host_tools/monitor/web_server.hpp"

#include <chrono>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include "host_tools/exit_codes.hpp"
#include "host_tools/monitor/web_assets.hpp"

namespace leadline::host {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using tcp = asio::ip::tcp;
using boost::system::error_code;

constexpr std::uint32_t kMaxHeader_bytes = 8192;
constexpr std::uint64_t kMaxBody_bytes = 1024;
// A request comes at once or not at all; a connection that is kept open may wait for the next one.
constexpr std::chrono::seconds kRequestTime{10};
// A viewer whose machine went away is noticed by unanswered pings after this.
constexpr std::chrono::seconds kViewerSilence{30};

using Request = http::request<http::string_body>;
using Response = http::response<http::string_body>;

std::string_view text_of(beast::string_view text) { return {text.data(), text.size()}; }

}  // namespace

class WebServer::Implementation {
 public:
  Implementation(const WebAddress& address, Handlers handlers)
      : handlers_(std::move(handlers)), acceptor_(io_) {
    const auto fail = [&address](const error_code& error) {
      const bool taken = error == asio::error::address_in_use;
      throw HostError(
          ExitCode::kUsage,
          "monitor: --http " + web_authority(address) + ": " + error.message() +
              (taken ? " (another monitor? --http 127.0.0.1:0 takes a free port)" : ""));
    };
    error_code error;
    const tcp::endpoint endpoint(asio::ip::make_address(address.host, error), address.port);
    if (error || acceptor_.open(endpoint.protocol(), error) ||
        acceptor_.set_option(asio::socket_base::reuse_address(true), error) ||
        acceptor_.bind(endpoint, error) ||
        acceptor_.listen(asio::socket_base::max_listen_connections, error)) {
      fail(error);
    }
    port_ = acceptor_.local_endpoint().port();
    accept();
  }
  ~Implementation();
  Implementation(const Implementation&) = delete;
  Implementation& operator=(const Implementation&) = delete;

  void run_for(int milliseconds) {
    // A loop that once found nothing to do stays stopped until it is told to start again.
    io_.restart();
    if (milliseconds > 0) {
      io_.run_for(std::chrono::milliseconds(milliseconds));
    } else {
      io_.poll();
    }
  }
  void wake();

  [[nodiscard]] std::uint16_t port() const { return port_; }
  [[nodiscard]] std::size_t viewers() const { return viewers_.size(); }

  WebCounters counters;

 private:
  class Visitor;
  class Viewer;

  void accept();

  Handlers handlers_;
  std::uint16_t port_ = 0;
  bool accepting_ = false;
  bool ending_ = false;
  std::size_t connections_ = 0;
  std::set<std::shared_ptr<Viewer>> viewers_;
  // Last, so that they go first: what is under way when the loop ends still finds the rest.
  asio::io_context io_{1};
  tcp::acceptor acceptor_;
};

/// A WebSocket.
class WebServer::Implementation::Viewer : public std::enable_shared_from_this<Viewer> {
 public:
  Viewer(Implementation* server, beast::tcp_stream stream)
      : server_(server), socket_(std::move(stream)) {}
  ~Viewer() {
    server_->connections_ -= 1;
    server_->accept();
  }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  void start(const Request& request) {
    beast::get_lowest_layer(socket_).expires_never();
    websocket::stream_base::timeout timeout{};
    timeout.handshake_timeout = kRequestTime;
    timeout.idle_timeout = kViewerSilence;
    timeout.keep_alive_pings = true;
    socket_.set_option(timeout);
    socket_.read_message_max(kMaxRequest_bytes);
    socket_.binary(true);
    socket_.async_accept(request, [self = shared_from_this()](error_code error) {
      if (error) {
        self->end();
        return;
      }
      self->open_ = true;
      self->read();
      self->send();
    });
  }

  /// Sends what is next, unless something is under way.
  void send() {
    if (!open_ || writing_) {
      return;
    }
    message_ = next_page_message(server_->handlers_.content(), &cursor_);
    if (!message_) {
      return;
    }
    writing_ = true;
    server_->counters.messages += 1;
    server_->counters.message_bytes += message_->bytes.size();
    socket_.text(message_->text);
    socket_.async_write(asio::buffer(message_->bytes),
                        [self = shared_from_this()](error_code error, std::size_t) {
                          self->writing_ = false;
                          if (error) {
                            self->end();
                          } else {
                            self->send();
                          }
                        });
  }

  void close() {
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().close(ignored);
  }

 private:
  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](error_code error, std::size_t) {
      if (error) {
        // Longer than allowed, or no WebSocket frame; a connection that simply ended is neither.
        const error_code closed = websocket::error::closed;
        const bool bad = error != closed && error.category() == closed.category();
        self->server_->counters.bad_messages += bad ? 1U : 0U;
        self->end();
        return;
      }
      self->take();
    });
  }

  void take() {
    const std::string text = beast::buffers_to_string(buffer_.data());
    buffer_.consume(buffer_.size());
    const std::optional<PageRequest> request =
        socket_.got_text() ? parse_page_request(text) : std::nullopt;
    if (!request) {
      server_->counters.bad_messages += 1;
      end();
      return;
    }
    server_->handlers_.request(*request);
    read();
  }

  void end() {
    open_ = false;
    server_->viewers_.erase(shared_from_this());
    close();
  }

  Implementation* server_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_static_buffer<kMaxRequest_bytes> buffer_;
  PageCursor cursor_;
  std::optional<PageMessage> message_;
  bool open_ = false;
  bool writing_ = false;
};

/// An HTTP connection.
class WebServer::Implementation::Visitor : public std::enable_shared_from_this<Visitor> {
 public:
  Visitor(Implementation* server, tcp::socket socket)
      : server_(server), stream_(std::move(socket)) {}
  ~Visitor() {
    if (!handed_over_) {
      server_->connections_ -= 1;
      server_->accept();
    }
  }
  Visitor(const Visitor&) = delete;
  Visitor& operator=(const Visitor&) = delete;

  void read() {
    parser_.emplace();
    parser_->header_limit(kMaxHeader_bytes);
    parser_->body_limit(kMaxBody_bytes);
    stream_.expires_after(kRequestTime);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](error_code error, std::size_t) {
                       if (!error) {
                         self->take();
                       }
                     });
  }

 private:
  void take() {
    Request request = parser_->release();
    server_->counters.requests += 1;
    const std::string host(text_of(request[http::field::host]));
    if (!host_allowed(host, server_->port_)) {
      server_->counters.refused_hosts += 1;
      answer(request, http::status::misdirected_request,
             "This monitor answers by its address or as localhost only.\n");
      return;
    }
    if (websocket::is_upgrade(request)) {
      upgrade(std::move(request), host);
      return;
    }
    if (request.method() != http::verb::get && request.method() != http::verb::head) {
      answer(request, http::status::method_not_allowed, "Only GET and HEAD.\n");
      return;
    }
    const std::string_view target = text_of(request.target());
    const WebAsset* const asset = find_web_asset(target == "/" ? "/index.html" : target);
    if (asset == nullptr) {
      answer(request, http::status::not_found, "There is nothing here.\n");
      return;
    }
    if (text_of(request[http::field::accept_encoding]).find("gzip") == std::string_view::npos) {
      answer(request, http::status::not_acceptable, "Ask with Accept-Encoding: gzip.\n");
      return;
    }
    Response response = make(request, http::status::ok);
    response.set(http::field::content_type, asset->content_type);
    response.set(http::field::content_encoding, "gzip");
    response.body().assign(reinterpret_cast<const char*>(asset->gzip), asset->gzip_bytes);
    send(std::move(response), request.method() == http::verb::head);
  }

  void upgrade(Request request, const std::string& host) {
    if (text_of(request.target()) != "/live") {
      answer(request, http::status::not_found, "There is nothing here.\n");
    } else if (!origin_allowed(text_of(request[http::field::origin]), host)) {
      server_->counters.refused_origins += 1;
      answer(request, http::status::forbidden, "Not from a page of somewhere else.\n");
    } else if (server_->viewers_.size() >= kMaxViewers) {
      server_->counters.refused_viewers += 1;
      answer(request, http::status::service_unavailable, "Too many viewers.\n");
    } else {
      const auto viewer = std::make_shared<Viewer>(server_, std::move(stream_));
      server_->viewers_.insert(viewer);
      handed_over_ = true;
      viewer->start(request);
    }
  }

  static Response make(const Request& request, http::status status) {
    Response response(status, request.version());
    response.keep_alive(request.keep_alive());
    response.set(http::field::server, "leadline");
    response.set(http::field::cache_control, "no-cache");
    response.set("Content-Security-Policy",
                 "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
                 "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
    response.set("X-Content-Type-Options", "nosniff");
    response.set("Referrer-Policy", "no-referrer");
    response.set("Cross-Origin-Resource-Policy", "same-origin");
    response.set("Cross-Origin-Opener-Policy", "same-origin");
    return response;
  }

  void answer(const Request& request, http::status status, const char* text) {
    Response response = make(request, status);
    response.set(http::field::content_type, "text/plain; charset=utf-8");
    response.body() = text;
    response.keep_alive(false);
    send(std::move(response), request.method() == http::verb::head);
  }

  void send(Response response, bool head) {
    response.prepare_payload();
    if (head) {
      response.body().clear();  // Content-Length stays what a GET would have
    }
    response_.emplace(std::move(response));
    stream_.expires_after(kRequestTime);
    http::async_write(stream_, *response_,
                      [self = shared_from_this()](error_code error, std::size_t) {
                        if (!error && self->response_->keep_alive()) {
                          self->read();
                        } else {
                          error_code ignored;
                          self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                        }
                      });
  }

  Implementation* server_;
  beast::tcp_stream stream_;
  bool handed_over_ = false;  ///< the connection is a viewer's now, who counts it
  beast::flat_static_buffer<kMaxHeader_bytes + kMaxBody_bytes> buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  std::optional<Response> response_;
};

void WebServer::Implementation::accept() {
  if (ending_ || accepting_ || connections_ >= kMaxConnections) {
    return;
  }
  accepting_ = true;
  acceptor_.async_accept([this](error_code error, tcp::socket socket) {
    accepting_ = false;
    if (!error) {
      connections_ += 1;
      error_code ignored;
      socket.set_option(tcp::no_delay(true), ignored);
      std::make_shared<Visitor>(this, std::move(socket))->read();
    }
    if (error != asio::error::operation_aborted) {
      accept();
    }
  });
}

void WebServer::Implementation::wake() {
  // A copy: a viewer whose connection is found broken leaves the set.
  const auto viewers = viewers_;
  for (const std::shared_ptr<Viewer>& viewer : viewers) {
    viewer->send();
  }
}

WebServer::Implementation::~Implementation() {
  ending_ = true;
  const auto viewers = std::exchange(viewers_, {});
  for (const std::shared_ptr<Viewer>& viewer : viewers) {
    viewer->close();
  }
}

WebServer::WebServer(const WebAddress& address, Handlers handlers)
    : implementation_(std::make_unique<Implementation>(address, std::move(handlers))) {}

WebServer::~WebServer() = default;

std::uint16_t WebServer::port() const { return implementation_->port(); }
void WebServer::run_for(int milliseconds) { implementation_->run_for(milliseconds); }
void WebServer::wake() { implementation_->wake(); }
std::size_t WebServer::viewers() const { return implementation_->viewers(); }
const WebCounters& WebServer::counters() const { return implementation_->counters; }

}  // namespace leadline::host
