// Swagger UI, from this computer: shows what /openapi.json says, and nothing else.
SwaggerUIBundle({
  url: "/openapi.json",
  dom_id: "#swagger-ui",
  deepLinking: true,
  validatorUrl: null,
});
