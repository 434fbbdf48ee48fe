% Receives triplets from Svev, live or replayed, and prints the mean grey value of each camera's frame.
%
%   Octave: apt install octave octave-zeromq, then: octave triplets.m tcp://127.0.0.1:5556
%   It ends when nothing has come for 10 s. In MATLAB the same messages come by JeroMQ, see zeromq.md.
pkg load zeromq

address = "tcp://127.0.0.1:5556";
if numel (argv ()) > 0
  address = argv (){1};
end
longest = 256 * 2^20;  % bytes of one part of a message

socket = zmq_socket (ZMQ_SUB);
zmq_setsockopt (socket, ZMQ_SUBSCRIBE, "triplet");
zmq_connect (socket, address);

while zmq_poll (socket, 10000)
  zmq_recv (socket, 1024);  % the topic; the other parts of the message are here when the first is
  tag = jsondecode (char (zmq_recv (socket, 2^20)));
  pixels = zmq_recv (socket, longest);

  rows = tag.shape(1);
  columns = tag.shape(2);
  printf ("pulse %d:", tag.pulse);
  whole = typecast (uint8 (pixels), tag.dtype);
  for k = 1:numel (tag.cameras)
    camera = tag.cameras(k);
    if iscell (tag.cameras)  % cameras whose parts of the tag have different members
      camera = tag.cameras{k};
    end
    if strcmp (camera.status, "ok") && numel (whole) == rows * columns
      image = reshape (whole, columns, rows)';  % Svev goes row by row, Octave column by column
      high = rows;
      if isfield (camera, "rows")
        high = camera.rows;
      end
      frame = image(1:high, camera.columns(1) + 1:camera.columns(2));
      printf (" %s %.2f", camera.name, mean (double (frame(:))));
    else
      printf (" %s %s", camera.name, camera.status);
    end
  end
  printf ("\n");
end
zmq_close (socket);
